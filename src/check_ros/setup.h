// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace view_servo::check
{
/** The arguments of homing.launch or arm_servo.launch that say how a robot is wired, with their names and defaults. */
struct Setup
{
  bool is_arm = false;
  std::string camera = "camera";
  std::string image_transport = "raw";
  std::string odom = "odom";                  // a base's
  std::string joint_states = "joint_states";  // an arm's
  std::string cmd_vel = "cmd_vel";
  std::string base_frame = "base_link";  // a base's
  std::string odom_frame = "base_link";  // an arm's; empty: do without
  std::string frame_prefix;              // of simulated robots
  std::string views_dir;
  bool dry_run = false;

  /** The frame in which tf has to know the camera; empty: none. */
  std::string fixedFrame() const
  {
    const std::string frame = is_arm ? odom_frame : base_frame;
    const std::string prefix = frame_prefix.substr(0, frame_prefix.find_last_not_of('/') + 1);
    return frame.empty() || prefix.empty() ? frame : prefix + "/" + frame;
  }
  std::string commandTopic() const
  {
    return dry_run ? "cmd_vel_dry" : cmd_vel;
  }
  std::string commandType() const
  {
    return is_arm ? "geometry_msgs/TwistStamped" : "geometry_msgs/Twist";
  }
};

}  // namespace view_servo::check
