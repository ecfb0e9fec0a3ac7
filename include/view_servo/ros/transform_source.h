// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <functional>
#include <string>

namespace view_servo
{
/**
 * What tf knows. Waits are by a steady clock: tf2's own timeouts are on ROS' clock, and do not end while that stands still.
 * Safe to use from several threads.
 */
class TransformSource
{
public:
  TransformSource();

  /**
   * What tf lacks to know `source` in `target` at a time, in one line; empty: nothing.
   * @param stamp ros::Time(0): the latest time at which it is known.
   */
  std::string missing(const std::string& target, const std::string& source, const ros::Time& stamp) const;

  /**
   * The transform that takes points of `source` to `target`, as soon as tf knows it.
   * @param patience longest wait for it [s]. @param given_up as in waitUntilReady(). @param stamp as above.
   * @throws std::runtime_error with what is missing.
   */
  geometry_msgs::TransformStamped lookUp(const std::string& target, const std::string& source, const ros::Time& stamp,
                                         double patience, const std::function<bool()>& given_up = {}) const;

private:
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
};

}  // namespace view_servo
