// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/control_node.h"

#include <ros/xmlrpc_manager.h>

#include <atomic>
#include <csignal>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
std::atomic<bool> g_shutdown_requested{ false };  // set by signals, read by several threads

void requestShutdown(int /*signal*/)
{
  g_shutdown_requested = true;
}

/** The master's call, as `rosnode kill` makes it. */
void shutdownCallback(XmlRpc::XmlRpcValue& /*parameters*/, XmlRpc::XmlRpcValue& result)
{
  g_shutdown_requested = true;
  result = ros::xmlrpc::responseInt(1, "", 0);
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
  const ros::WallDuration period(0.1);
  const bool changed = status.state != last_.state || status.reason != last_.reason;
  if (changed)
  {
    ROS_INFO_STREAM(status.reason);
  }
  const ros::WallTime now = ros::WallTime::now();
  const bool moving = status.state == ServoStatus::SERVOING || status.state == ServoStatus::ACQUIRING;
  if (changed || (moving && now - last_time_ >= period))
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
  return last.state == (gate.open() ? ServoStatus::DISABLED : ServoStatus::IDLE);
}

void detail::deferShutdown()
{
  g_shutdown_requested = false;
  std::signal(SIGINT, requestShutdown);
  std::signal(SIGTERM, requestShutdown);
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", shutdownCallback);
}

bool detail::shutdownRequested()
{
  return g_shutdown_requested;
}

}  // namespace view_servo
