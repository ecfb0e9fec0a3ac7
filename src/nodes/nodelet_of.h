// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/hosted_node.h"
#include "view_servo/ros/node_type.h"

#include <nodelet/nodelet.h>
#include <ros/console.h>

#include <exception>
#include <memory>

namespace view_servo
{
/** A node of one class as a nodelet. One that refuses to start says why, as its process does, and is not loaded. */
template <const NodeType& TYPE>
class NodeletOf : public nodelet::Nodelet
{
private:
  void onInit() override
  {
    try
    {
      node_ = std::make_unique<HostedNode>(TYPE, getNodeHandle(), getPrivateNodeHandle());
    }
    catch (const std::exception& error)
    {
      ROS_FATAL_STREAM(error.what());
      throw;  // the manager goes on
    }
  }

  std::unique_ptr<HostedNode> node_;
};

}  // namespace view_servo
