// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <ros/wall_timer.h>
#include <boost/function.hpp>

#include <cstdint>
#include <exception>
#include <string>

namespace view_servo
{
/** An exception's text without line breaks. */
std::string oneLine(const std::exception& error);

/** A time [s] for people. */
std::string seconds(double value);

/**
 * Lets the process keep the memory that it has freed. Images come and go with every cycle; to ask the system for them
 * each time costs a third of the time that it takes to work on them. Does nothing where the C library is not glibc.
 */
void keepFreedMemory();

/**
 * What all nodes share: handles, services that answer whatever happens, and `/diagnostics` once a second of wall time,
 * so that it goes on when a bag's clock does not.
 */
class NodeBase
{
public:
  NodeBase(const NodeBase&) = delete;
  NodeBase& operator=(const NodeBase&) = delete;

protected:
  NodeBase(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~NodeBase() = default;

  /**
   * Offers a private service; what `method` throws becomes success = false and the message.
   * @return the service's handle, to be kept.
   */
  template <typename Node, typename Request, typename Response>
  ros::ServiceServer serve(const std::string& name, void (Node::*method)(const Request&, Response&), Node* node)
  {
    const boost::function<bool(Request&, Response&)> callback = [method, node](Request& request, Response& response) {
      try
      {
        (node->*method)(request, response);
      }
      catch (const std::exception& error)
      {
        response.success = false;
        response.message = oneLine(error);
        ROS_WARN_STREAM(response.message);
      }
      return true;
    };
    return private_nh_.advertiseService(name, callback);
  }

  ros::NodeHandle nh_;
  ros::NodeHandle private_nh_;
  diagnostic_updater::Updater diagnostics_;

private:
  ros::WallTimer diagnostics_timer_;
};

/**
 * A node's main(): spins on a few threads, so that images go on arriving while a service works.
 * @return 1 when the node refuses to start.
 */
template <typename Node>
int runNode(int argc, char** argv, const std::string& name)
{
  constexpr std::uint32_t SPINNER_THREADS = 3;
  keepFreedMemory();
  ros::init(argc, argv, name);
  const ros::NodeHandle nh;  // outlives the node: without any handle, ROS ends and the last words are lost
  try
  {
    Node node(nh, ros::NodeHandle("~"));
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
