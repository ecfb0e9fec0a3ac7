// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/homing.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/readiness.h"

#include <filesystem>
#include <string>

namespace view_servo
{
/** Parameters that all drivers have. */
struct DriverParams
{
  double timeout = 60.0;                   ///< of a goal that has none of its own [s], > 0
  double control_rate = 50.0;              ///< of commands [Hz], [10, 1000]
  double start_patience = START_PATIENCE;  ///< longest wait of a goal for what it needs before it begins [s], > 0

  void read(ParameterReader& reader);
};

/** Parameters of the node homing, which documents them. */
struct HomingDriverParams
{
  DriverParams node;
  CameraInputParams camera;
  std::filesystem::path views_dir;
  std::string view;
  std::string base_frame = "base_link";
  double image_timeout = 0.25;
  double odometry_timeout = 0.25;
  double match_timeout = 0.25;
  double lost_timeout = 10.0;
  HomingParams homing;
  VelocityLimits limits;

  static HomingDriverParams read(ParameterReader& reader);
};

/** Parameters of the node servo_25d, which documents them. */
struct ServoDriverParams
{
  DriverParams node;
  std::filesystem::path views_dir;
  double acquire_timeout = 15.0;
  double homography_timeout = 0.25;
  double max_homography_age = 0.5;
  double joint_margin = 0.02;
  double joint_timeout = 1.0;
  double lost_timeout = 5.0;
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;

  static ServoDriverParams read(ParameterReader& reader);
};

}  // namespace view_servo
