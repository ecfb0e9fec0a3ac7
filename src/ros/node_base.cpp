// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/node_base.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>  // says whether this is glibc
#include <iostream>
#include <optional>
#include <sstream>
#include <utility>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace view_servo
{
NodeBase::NodeBase(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
  : nh_(nh), private_nh_(private_nh), diagnostics_(nh, private_nh, private_nh.getNamespace())
{
  diagnostics_.setHardwareID("none");
  diagnostics_timer_ = every(1.0, "diagnostics", [this] { diagnostics_.force_update(); });
}

std::string seconds(double value)
{
  std::ostringstream text;
  text.precision(3);
  text << value << " s";
  return text.str();
}

double secondsBetween(const ros::Time& from, const ros::Time& to)
{
  return to.toSec() - from.toSec();
}

double ageOf(const ros::Time& stamp)
{
  return secondsBetween(stamp, ros::Time::now());
}

std::string remedyOfAge(double age)
{
  constexpr double FROM_A_BAG = 60.0;  // nothing is so late that comes from a robot [s]
  return age > FROM_A_BAG && !ros::Time::isSimTime()
             ? "; if it is from a bag, set use_sim_time before the nodes start, and play it with rosbag play --clock"
             : "";
}

ExitDeadline::ExitDeadline(std::function<bool()> asked, int status)
  : status_(status), thread_([this, asked = std::move(asked)] { watch(asked); })
{
}

ExitDeadline::~ExitDeadline()
{
  over_ = true;
  thread_.join();
}

void ExitDeadline::watch(const std::function<bool()>& asked)
{
  constexpr std::chrono::milliseconds POLL(20);
  constexpr std::chrono::milliseconds PATIENCE(1500);
  std::optional<std::chrono::steady_clock::time_point> since;
  while (!over_)
  {
    const auto now = std::chrono::steady_clock::now();
    if (since && now - *since > PATIENCE)
    {
      std::fputs("ended at once: the node did not end in time by itself\n", stderr);
      std::_Exit(status_);
    }
    if (!since && asked())
    {
      since = now;
    }
    std::this_thread::sleep_for(POLL);
  }
}

StampOrder::Place StampOrder::check(const ros::Time& stamp)
{
  constexpr double FAR = 0.5;  // [s]
  constexpr int OFTEN = 3;     // two publishers take turns; three in a row are no chance
  behind_ = secondsBetween(stamp, newest_);
  if (newest_.isZero() || stamp > newest_)
  {
    newest_ = stamp;
    far_late_ = 0;
    return NEWEST;
  }
  if (stamp == newest_)
  {
    return REPEATED;
  }
  if (behind_ <= FAR)
  {
    far_late_ = 0;
    return LATE;
  }
  if (++far_late_ < OFTEN)
  {
    return FAR_LATE;
  }
  newest_ = stamp;
  far_late_ = 0;
  return GONE_BACK;
}

void keepFreedMemory()
{
#ifdef __GLIBC__
  constexpr int LARGEST_BLOCK = 32 << 20;  // taken from the heap, which is kept [bytes]
  constexpr int KEPT = 256 << 20;          // at the heap's end [bytes]
  mallopt(M_MMAP_THRESHOLD, LARGEST_BLOCK);
  mallopt(M_TRIM_THRESHOLD, KEPT);
#endif
}

std::optional<int> answerCommandLine(int argc, char** argv, const std::string& name)
{
  for (int i = 1; i < argc; ++i)
  {
    const std::string word = argv[i];
    if (word == "--help" || word == "-h")
    {
      std::cout << "Usage: rosrun view_servo " << name << " [_PARAMETER:=VALUE ...] [NAME:=OTHER_NAME ...]\n\n"
                << "A ROS node, which needs a master: roscore, or a launch file, starts one. Its topics, services and\n"
                << "parameters are in docs/nodes.md; roslaunch view_servo, and the tab key, name the launch files.\n";
      return 0;
    }
    if (word.find(":=") == std::string::npos)
    {
      std::cerr << name << ": '" << word << "' is not understood: parameters are set by _NAME:=VALUE; see --help"
                << std::endl;
      return 2;
    }
  }
  return std::nullopt;
}

}  // namespace view_servo
