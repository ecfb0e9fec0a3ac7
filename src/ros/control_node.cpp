// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/control_node.h"

#include <ros/init.h>
#include <ros/xmlrpc_manager.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <csignal>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
std::atomic<bool> g_shutdown_requested{ false };  // set by signals, read by several threads
std::atomic<bool> g_is_deferred{ false };         // somebody looks at it

void requestShutdown(int /*signal*/)
{
  g_shutdown_requested = true;
}

/** Of a terminal that is closed, unless the program is to outlive that, as by nohup. @return the handler of before. */
void (*catchHangUp())(int)
{
  void (*const before)(int) = std::signal(SIGHUP, requestShutdown);
  if (before == SIG_IGN)
  {
    std::signal(SIGHUP, SIG_IGN);
  }
  return before;
}

/** The master's call, as `rosnode kill` makes it. */
void shutdownCallback(XmlRpc::XmlRpcValue& /*parameters*/, XmlRpc::XmlRpcValue& result)
{
  g_is_deferred ? requestShutdown(SIGTERM) : ros::requestShutdown();
  result = ros::xmlrpc::responseInt(1, "", 0);
}

/** Those who want to stop robots, and the thread that has them do so when a shutdown is requested. */
class ShutdownWatch
{
public:
  void add(const std::function<void()>& stop)
  {
    const std::lock_guard<std::mutex> alone(members_mutex_);
    const bool first = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      stops_.push_back(&stop);
      return stops_.size() == 1;
    }();
    if (first)
    {
      before_.interrupt = std::signal(SIGINT, requestShutdown);
      before_.terminate = std::signal(SIGTERM, requestShutdown);
      before_.hang_up = catchHangUp();
      detail::deferShutdown();
      over_ = false;
      thread_ = std::thread([this] { watch(); });
    }
  }

  void remove(const std::function<void()>& stop)
  {
    const std::lock_guard<std::mutex> alone(members_mutex_);
    const bool last = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);  // not while it is called
      stops_.erase(std::find(stops_.begin(), stops_.end(), &stop));
      return stops_.empty();
    }();
    if (last)
    {
      over_ = true;
      thread_.join();
      std::signal(SIGINT, before_.interrupt);
      std::signal(SIGTERM, before_.terminate);
      std::signal(SIGHUP, before_.hang_up);
      g_is_deferred = false;
      if (g_shutdown_requested)
      {
        ros::requestShutdown();  // it came after the thread's last look
      }
    }
  }

private:
  void watch()
  {
    const ros::WallDuration poll(0.01);
    while (!over_ && !g_shutdown_requested)
    {
      poll.sleep();
    }
    if (!g_shutdown_requested)
    {
      return;
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const std::function<void()>* stop : stops_)
      {
        guarded("the end", *stop);
      }
    }
    waitForLastCommand();
    ros::requestShutdown();
  }

  std::mutex members_mutex_;  // held while one comes or goes; taken before the other one
  std::mutex mutex_;          // guards stops_
  std::vector<const std::function<void()>*> stops_;
  std::atomic<bool> over_{ false };
  struct
  {
    void (*interrupt)(int) = SIG_DFL;
    void (*terminate)(int) = SIG_DFL;
    void (*hang_up)(int) = SIG_DFL;
  } before_;  // handlers of the signals
  std::thread thread_;
};

ShutdownWatch& shutdownWatch()
{
  static ShutdownWatch watch;
  return watch;
}

/** A reason with its numbers left out, as of ages, which are others in every cycle. */
std::string withoutNumbers(std::string reason)
{
  const auto is_of_number = [](unsigned char c) {
    return std::isdigit(c) != 0 || c == '.';
  };
  reason.erase(std::remove_if(reason.begin(), reason.end(), is_of_number), reason.end());
  return reason;
}

}  // namespace

std_srvs::SetBool::Response CommandGate::set(bool enabled)
{
  enabled_ = enabled;
  std_srvs::SetBool::Response response;
  response.success = 1;
  response.message = enabled ? "enabled" : "disabled";
  response.message += dry_run_ ? ", in dry run" : "";
  ROS_INFO_STREAM(response.message);
  return response;
}

StatusOutput::StatusOutput(ros::NodeHandle& nh)
  : publisher_(nh.advertise<ServoStatus>("status", 1, true)), last_(makeStatus(ServoStatus::IDLE, ""))
{
}

void StatusOutput::publish(ServoStatus status)
{
  constexpr std::chrono::milliseconds PERIOD(100);
  const bool moving = status.state == ServoStatus::SERVOING || status.state == ServoStatus::ACQUIRING;
  const bool changed =
      status.state != last_.state ||
      (moving ? withoutNumbers(status.reason) != withoutNumbers(last_.reason) : status.reason != last_.reason);
  if (changed)
  {
    ROS_INFO_STREAM(status.reason);
  }
  const auto now = std::chrono::steady_clock::now();
  if (changed || (moving && now - last_time_ >= PERIOD))
  {
    publisher_.publish(status);
    last_time_ = now;
  }
  last_ = std::move(status);
}

ServoStatus makeStatus(std::uint8_t state, const std::string& reason)
{
  ServoStatus status;
  status.header.stamp = ros::Time::now();
  status.state = state;
  status.reason = reason;
  status.translation_error = std::numeric_limits<double>::quiet_NaN();
  status.rotation_error = std::numeric_limits<double>::quiet_NaN();
  status.point_error = std::numeric_limits<double>::quiet_NaN();
  return status;
}

ServoStatus idleStatus(const CommandGate& gate)
{
  return gate.open() ? makeStatus(ServoStatus::IDLE, "waits for a goal")
                     : makeStatus(ServoStatus::DISABLED, "does not drive until ~enable is called");
}

bool isOutdated(const ServoStatus& last, const CommandGate& gate)
{
  return (last.state == ServoStatus::DISABLED) == gate.open();
}

void detail::deferShutdown()
{
  g_shutdown_requested = false;
  g_is_deferred = true;
  std::signal(SIGINT, requestShutdown);
  std::signal(SIGTERM, requestShutdown);
  catchHangUp();
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", shutdownCallback);
}

bool detail::shutdownRequested()
{
  return g_shutdown_requested;
}

void waitForLastCommand()
{
  ros::WallDuration(0.1).sleep();
}

StopBeforeShutdown::StopBeforeShutdown(std::function<void()> stop) : stop_(std::move(stop))
{
  shutdownWatch().add(stop_);
}

StopBeforeShutdown::~StopBeforeShutdown()
{
  shutdownWatch().remove(stop_);
}

}  // namespace view_servo
