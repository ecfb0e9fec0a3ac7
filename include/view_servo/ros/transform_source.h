// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <ros/time.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <functional>
#include <string>

namespace view_servo
{
/** The name of a frame as tf2 knows it: older nodes put a slash before it. */
std::string withoutSlash(const std::string& frame);

/**
 * Looks transforms up in tf. Frames may have a slash before their names. Waits are by a steady clock; tf2's own
 * timeouts are on the clock of ROS, and do not end while that stands still. Safe to use from several threads.
 */
class TransformSource
{
public:
  /** @param nh names `/tf` and `/tf_static`, with its remappings. */
  explicit TransformSource(const ros::NodeHandle& nh = ros::NodeHandle());

  /**
   * Why tf cannot give the transform from `source` to `target` at a time, in one line; empty when it can.
   * @param stamp the time; ros::Time(0): the latest time at which the transform is known.
   */
  std::string missing(const std::string& target, const std::string& source, const ros::Time& stamp) const;

  /**
   * Waits until tf knows the transform that maps points of `source` to `target`, and returns it.
   * @param patience longest wait [s]. @param given_up as in waitUntilReady(). @param stamp as above.
   * @throws std::runtime_error with what is missing.
   */
  geometry_msgs::TransformStamped lookUp(const std::string& target, const std::string& source, const ros::Time& stamp,
                                         double patience, const std::function<bool()>& given_up = {}) const;

private:
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
};

}  // namespace view_servo
