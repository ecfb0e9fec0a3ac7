// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <ros/wall_timer.h>

#include <cstdint>
#include <exception>
#include <string>

namespace view_servo
{
/**
 * What all nodes share: handles, and `/diagnostics` once a second of wall time, so that it goes on when a bag's clock
 * does not.
 */
class NodeBase
{
public:
  NodeBase(const NodeBase&) = delete;
  NodeBase& operator=(const NodeBase&) = delete;

protected:
  NodeBase(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~NodeBase() = default;

  ros::NodeHandle nh_;
  ros::NodeHandle private_nh_;
  diagnostic_updater::Updater diagnostics_;

private:
  ros::WallTimer diagnostics_timer_;
};

/** An exception's text without line breaks. */
std::string oneLine(const std::exception& error);

/**
 * Runs a service: whatever it throws becomes success = false and the message.
 * @return what a service callback returns: the request was answered.
 */
template <typename Response, typename Function>
bool answer(Response& response, Function&& function)
{
  try
  {
    function();
  }
  catch (const std::exception& error)
  {
    response.success = false;
    response.message = oneLine(error);
    ROS_WARN_STREAM(response.message);
  }
  return true;
}

/**
 * A node's main(): spins on a few threads, so that images go on arriving while a service works.
 * @return 1 when the node refuses to start.
 */
template <typename Node>
int runNode(int argc, char** argv, const std::string& name)
{
  constexpr std::uint32_t SPINNER_THREADS = 3;
  ros::init(argc, argv, name);
  try
  {
    Node node{ ros::NodeHandle(), ros::NodeHandle("~") };
    ros::MultiThreadedSpinner(SPINNER_THREADS).spin();
    return 0;
  }
  catch (const std::exception& error)
  {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
}

}  // namespace view_servo
