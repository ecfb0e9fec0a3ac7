// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <string>

namespace view_servo
{
/**
 * Publishes what homing sends besides its status: commands as Twist and TwistStamped, the heading, with an arrow for
 * rviz, `view_pose`, where the base has to be, in odometry's frame, and `base_pose`, where it is, in the view's frame.
 */
class BaseOutput
{
public:
  /** @param command_topic topic of the Twist; the TwistStamped goes to the same name with "_stamped" appended. */
  BaseOutput(ros::NodeHandle& nh, const std::string& command_topic, std::string base_frame);

  /** Publishes a command. */
  void publish(const BaseVelocity& velocity) const;
  /** Publishes the heading, and the arrow and the poses while they are known. @param view name of the stored view. */
  void publish(const HomingReport& report, const std::string& odom_frame, const std::string& view) const;

  /** Whether somebody subscribes to commands. */
  bool hasListener() const;

private:
  std::string base_frame_;
  ros::Publisher commands_;
  ros::Publisher stamped_commands_;
  ros::Publisher headings_;
  ros::Publisher arrows_;
  ros::Publisher view_poses_;
  ros::Publisher base_poses_;
};

}  // namespace view_servo
