// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/control_node.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_type.h"

#include <ros/node_handle.h>

#include <memory>
#include <string>

namespace view_servo
{
namespace detail
{
template <typename Node>
class RunningNodeOf : public RunningNode
{
public:
  RunningNodeOf(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh) : node_(nh, private_nh)
  {
  }

  void giveUp() override
  {
    giveUp(node_, 0);
  }

protected:
  Node node_;

private:
  template <typename Any>
  static auto giveUp(Any& node, int /*preferred*/) -> decltype(node.giveUp())
  {
    node.giveUp();
  }
  template <typename Any>
  static void giveUp(Any& /*node*/, long /*otherwise*/)
  {
  }
};

template <typename Node>
class RunningDriverOf : public RunningNodeOf<Node>
{
public:
  using RunningNodeOf<Node>::RunningNodeOf;

  void stop() override
  {
    this->node_.stop();
  }
};

template <typename Running>
std::unique_ptr<RunningNode> makeRunning(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
{
  return std::make_unique<Running>(nh, private_nh);
}
}  // namespace detail

/** @param name of the process, unless it is started by another one. */
template <typename Node>
NodeType nodeType(const std::string& name)
{
  return { [name](int argc, char** argv) { return runNode<Node>(argc, argv, name); },
           detail::makeRunning<detail::RunningNodeOf<Node>>, NODE_THREADS, false };
}

/** The same for a node that drives a robot. */
template <typename Node>
NodeType driverType(const std::string& name)
{
  return { [name](int argc, char** argv) { return runControlNode<Node>(argc, argv, name); },
           detail::makeRunning<detail::RunningDriverOf<Node>>, CONTROL_NODE_THREADS, true };
}

}  // namespace view_servo
