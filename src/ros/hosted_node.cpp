// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/hosted_node.h"

namespace view_servo
{
HostedNode::HostedNode(const NodeType& type, ros::NodeHandle nh, ros::NodeHandle private_nh)
  : requests_(private_nh), spinner_(type.threads, &queue_)
{
  keepFreedMemory();
  nh.setCallbackQueue(&queue_);
  node_ = type.make(nh, private_nh);
  if (type.drives)
  {
    stop_before_shutdown_ = std::make_unique<StopBeforeShutdown>([this] { node_->stop(); });
  }
  requests_.start();
  spinner_.start();
}

HostedNode::~HostedNode()
{
  if (stop_before_shutdown_)
  {
    stop_before_shutdown_.reset();
    guarded("the end", [this] { node_->stop(); });
    waitForLastCommand();
  }
  // As in a process of its own, the node ends after its last callback; the nodelet manager waits for that.
  node_->giveUp();
  requests_.stop();
  spinner_.stop();
  node_.reset();
}

}  // namespace view_servo
