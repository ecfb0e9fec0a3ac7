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
#include <vector>

namespace view_servo
{
/** Parameters that all drivers have. */
struct DriverParams
{
  bool dry_run = false;
  double timeout = 60.0;                   // [s]
  double control_rate = 50.0;              // [Hz]
  double start_patience = START_PATIENCE;  // [s]
};

/** Names, units, ranges and meanings of these parameters, here and below. */
std::vector<Parameter> parameters(DriverParams& params);

/** Parameters of the node homing. */
struct HomingDriverParams
{
  DriverParams node;
  CameraInputParams camera;
  std::filesystem::path views_dir;
  std::string view;
  std::string base_frame = "base_link";
  double image_timeout = 0.25;
  double odometry_timeout = 0.25;
  double odometry_delay = 0.0;
  double match_timeout = 0.25;
  HomingParams homing;
  VelocityLimits limits;

  HomingDriverParams()
  {
    node.timeout = 120.0;
  }

  /** Time after which a goal without an input ends [s]. */
  double patience() const
  {
    return homing.lost_timeout;
  }
  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(HomingDriverParams& params);

/** Parameters of the node servo_25d. */
struct ServoDriverParams
{
  DriverParams node;
  std::filesystem::path views_dir;
  double acquire_timeout = 15.0;
  double homography_timeout = 0.25;
  double max_homography_age = 0.5;
  double joint_margin = 0.02;
  double joint_timeout = 1.0;
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;

  double patience() const
  {
    return servo.lost_timeout;
  }
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(ServoDriverParams& params);

}  // namespace view_servo
