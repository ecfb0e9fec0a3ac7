// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ServoStatus.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <ros/publisher.h>
#include <std_srvs/SetBool.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace view_servo
{
/**
 * Whether a node may drive: off at start, switched by the service `~enable` (std_srvs/SetBool). In a dry run
 * commands go to other topics, whatever the gate says.
 */
class CommandGate
{
public:
  explicit CommandGate(bool dry_run) : dry_run_(dry_run)
  {
  }

  /** Opens or closes the gate, and says so in the response. */
  std_srvs::SetBool::Response set(bool enabled);
  /** Whether `~enable` was last called with true. */

  bool enabled() const
  {
    return enabled_;
  }
  /** As given to the constructor. */
  bool dryRun() const
  {
    return dry_run_;
  }
  /** Whether commands are to be sent at all. */
  bool open() const
  {
    return enabled_ || dry_run_;
  }

private:
  bool dry_run_;
  std::atomic<bool> enabled_{ false };
};

/**
 * Publishes a ServoStatus, latched: at once when its state or reason changes, else at most ten times a second. While it
 * looks for the view or drives, a reason with other numbers is the same.
 */
class StatusOutput
{
public:
  explicit StatusOutput(ros::NodeHandle& nh);

  /** Publishes it if state or reason has changed, or 0.1 s after the last one while it looks for the view or drives. */
  void publish(ServoStatus status);

  /** The status given to publish() last, whether it was published or not. */
  const ServoStatus& last() const
  {
    return last_;
  }

private:
  ros::Publisher publisher_;
  ServoStatus last_;
  std::chrono::steady_clock::time_point last_time_;
};

/** A status without errors or inliers, stamped now. */
ServoStatus makeStatus(std::uint8_t state, const std::string& reason);

/** In the reason of a status without a goal, what comes before how the last goal ended. */
constexpr const char* LAST_GOAL = "; the last goal: ";

/** The status of a node without a goal. */
ServoStatus idleStatus(const CommandGate& gate);

/** Whether idleStatus() has to be published, without a goal, because the gate was switched after the last status. */
bool isOutdated(const ServoStatus& last, const CommandGate& gate);

/** After a robot was moved, zeros are sent for some cycles, and then nothing, so that another node may drive it. */
class StopBurst
{
public:
  /** To be called when a command was sent. */
  void sent(bool zero)
  {
    count_ = zero ? count_ + 1 : 0;
    ever_ = true;
  }
  /** Whether another zero has to be sent. */
  bool due() const
  {
    constexpr int ENOUGH = 20;
    return ever_ && count_ < ENOUGH;
  }

private:
  int count_ = 0;      // zeros sent in a row
  bool ever_ = false;  // a command was sent
};

namespace detail
{
/**
 * From now on SIGINT, SIGTERM, SIGHUP (a terminal was closed; unless it is ignored, as by nohup) and the master's order
 * to shut down only make shutdownRequested() true, so that a node can stop its robot before ROS ends.
 */
void deferShutdown();
/** Whether one of these has come since deferShutdown(). */
bool shutdownRequested();
}  // namespace detail

/** Lets the last command leave, which ROS sends by a thread of its own. */
void waitForLastCommand();

/** Threads that call the callbacks of a node that drives a robot. */
constexpr std::uint32_t CONTROL_NODE_THREADS = 4;

/**
 * Has a robot stopped before ROS shuts down in a process that belongs to somebody else. From the first one to the end
 * of the last, SIGINT, SIGTERM, SIGHUP and the master's order to shut down first have `stop` called of all of them, and then
 * shut ROS down.
 */
class StopBeforeShutdown
{
public:
  /** @param stop sends zero; called by a thread of its own, at most once, and never after this has ended. */
  explicit StopBeforeShutdown(std::function<void()> stop);
  ~StopBeforeShutdown();
  StopBeforeShutdown(const StopBeforeShutdown&) = delete;
  StopBeforeShutdown& operator=(const StopBeforeShutdown&) = delete;

private:
  const std::function<void()> stop_;
};

/**
 * As runNode(), for a node that drives a robot: its `stop()`, which sends zero, is called before ROS shuts down.
 * @return 1 when the node refuses to start; else as answerCommandLine().
 */
template <typename Node>
int runControlNode(int argc, char** argv, const std::string& name)
{
  if (const std::optional<int> status = answerCommandLine(argc, argv, name))
  {
    return *status;
  }
  const ros::WallDuration poll(0.01);
  keepFreedMemory();
  const ExitDeadline exit_deadline(&detail::shutdownRequested);
  ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
  const ros::NodeHandle nh;
  detail::deferShutdown();
  try
  {
    ros::NodeHandle private_nh("~");
    RequestThreads requests(private_nh);
    Node node(nh, private_nh);
    requests.start();
    ros::AsyncSpinner spinner(CONTROL_NODE_THREADS);
    spinner.start();
    while (ros::ok() && !detail::shutdownRequested())
    {
      poll.sleep();
    }
    guarded("the end", [&] { node.stop(); });
    waitForLastCommand();
    requests.stop();
    spinner.stop();
    ros::shutdown();
    return 0;
  }
  catch (const std::exception& error)
  {
    ROS_FATAL_STREAM(error.what());
    ros::shutdown();
    return 1;
  }
}

}  // namespace view_servo
