// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/control_node.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_type.h"

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <memory>

namespace view_servo
{
/**
 * A node in a process that it shares with others, as a nodelet does. It has queues and threads of its own, as many as
 * in a process of its own: a slow service or callback of one node keeps no other waiting, and no driver's control.
 *
 * Where the node drives a robot, zero is sent before this ends, and before the process does by a signal or by the
 * master (see StopBeforeShutdown).
 */
class HostedNode
{
public:
  /**
   * @param nh and @param private_nh name what the node subscribes and publishes; their queues are not used.
   * @throws what the node's constructor throws when it refuses to start.
   */
  HostedNode(const NodeType& type, ros::NodeHandle nh, ros::NodeHandle private_nh);
  ~HostedNode();
  HostedNode(const HostedNode&) = delete;
  HostedNode& operator=(const HostedNode&) = delete;

private:
  ros::CallbackQueue queue_;
  RequestThreads requests_;
  std::unique_ptr<RunningNode> node_;
  std::unique_ptr<StopBeforeShutdown> stop_before_shutdown_;  // of a driver
  ros::AsyncSpinner spinner_;
};

}  // namespace view_servo
