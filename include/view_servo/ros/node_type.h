// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

namespace ros
{
class NodeHandle;
}

namespace view_servo
{
/** A node while it runs, whichever class it is of. Its end is the node's. */
class RunningNode
{
public:
  RunningNode() = default;
  virtual ~RunningNode() = default;
  RunningNode(const RunningNode&) = delete;
  RunningNode& operator=(const RunningNode&) = delete;

  /** Of a node that may work on a request for long: ends that early. To be called before its callbacks are waited for. */
  virtual void giveUp()
  {
  }
  /** Of a node that drives a robot: sends zero; after that, it does not drive any more. */
  virtual void stop()
  {
  }
};

/** One class of nodes, as a process of its own and as a guest in another one (see HostedNode). */
struct NodeType
{
  std::function<int(int argc, char** argv)> run;  ///< main() of the process
  std::function<std::unique_ptr<RunningNode>(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)> make;
  std::uint32_t threads;  ///< that call the node's callbacks
  bool drives;            ///< a robot: stop() has to be called before ROS shuts down
};

}  // namespace view_servo
