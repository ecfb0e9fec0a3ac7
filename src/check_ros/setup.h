// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace view_servo::check
{
/** Where a base's driver publishes its commands with a stamp, for bases that want these. */
constexpr const char* STAMPED_COMMANDS = "cmd_vel_stamped";

/** The arguments of homing.launch or arm_servo.launch that say how a robot is wired, with their names and defaults. */
struct Setup
{
  bool is_arm = false;  // arguments are those of arm_servo.launch
  std::string camera = "camera";
  std::string image = "image_raw";
  std::string image_transport = "raw";
  std::string odom = "odom";                  // of a base
  std::string joint_states = "joint_states";  // of an arm
  std::string cmd_vel = "cmd_vel";
  std::string base_frame = "base_link";  // of a base
  bool slides = true;                    // of a base: it is holonomic
  std::string odom_frame = "base_link";  // of an arm, the frame that it stands in; empty: do without tf
  std::string frame_prefix;              // put before frames of simulated robots
  std::string views_dir;
  bool dry_run = false;

  /** The frame in which tf has to know the camera; empty: none. */
  std::string fixedFrame() const
  {
    const std::string frame = is_arm ? odom_frame : base_frame;
    const std::string prefix = frame_prefix.substr(0, frame_prefix.find_last_not_of('/') + 1);
    return frame.empty() || prefix.empty() ? frame : prefix + "/" + frame;
  }
  /** Topic that the driver publishes commands on, before resolving. */
  std::string commandTopic() const
  {
    return dry_run ? "cmd_vel_dry" : cmd_vel;
  }
  /** Type of the messages on it. */
  std::string commandType() const
  {
    return is_arm ? "geometry_msgs/TwistStamped" : "geometry_msgs/Twist";
  }
};

}  // namespace view_servo::check
