// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/driver_params.h"

#include "view_servo/control/homing_parameters.h"
#include "view_servo/control/servo_parameters.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/views/view_store.h"

namespace view_servo
{
void DriverParams::read(ParameterReader& reader)
{
  reader.read("timeout", timeout);
  reader.require(timeout > 0.0, "~timeout must be more than 0 s");
  reader.read("control_rate", control_rate);
  reader.require(control_rate >= 10.0 && control_rate <= 1000.0, "~control_rate must lie in [10, 1000] Hz");
  reader.read("start_patience", start_patience);
  reader.require(start_patience > 0.0, "~start_patience must be more than 0 s");
}

HomingDriverParams HomingDriverParams::read(ParameterReader& reader)
{
  HomingDriverParams params;
  params.node.timeout = 120.0;
  params.node.read(reader);
  params.camera = CameraInputParams::read(reader);
  params.views_dir = readViewsDir(reader);
  reader.read("view", params.view);
  reader.require(params.view.empty() || isValidViewName(params.view),
                 "~view: '" + params.view + "' is not a view's name");
  reader.read("base_frame", params.base_frame);
  reader.require(!params.base_frame.empty(), "~base_frame must not be empty");
  reader.read("image_timeout", params.image_timeout);
  reader.read("odometry_timeout", params.odometry_timeout);
  reader.read("match_timeout", params.match_timeout);
  reader.require(params.image_timeout > 0.0 && params.odometry_timeout > 0.0 && params.match_timeout > 0.0,
                 "~image_timeout, ~odometry_timeout and ~match_timeout must be more than 0 s");
  reader.read(homingParameters(params.homing, params.limits));
  reader.addFaults(params.homing.validate());
  reader.addFaults(params.limits.validate());
  params.lost_timeout = params.homing.lost_timeout;
  return params;
}

ServoDriverParams ServoDriverParams::read(ParameterReader& reader)
{
  ServoDriverParams params;
  params.node.read(reader);
  params.views_dir = readViewsDir(reader);
  reader.read("acquire_timeout", params.acquire_timeout);
  reader.read("homography_timeout", params.homography_timeout);
  reader.read("max_homography_age", params.max_homography_age);
  reader.read("joint_timeout", params.joint_timeout);
  reader.require(params.acquire_timeout > 0.0 && params.homography_timeout > 0.0 && params.max_homography_age > 0.0 &&
                     params.joint_timeout > 0.0,
                 "~acquire_timeout, ~homography_timeout, ~max_homography_age and ~joint_timeout must be more than 0 s");
  reader.read("joint_margin", params.joint_margin);
  reader.require(params.joint_margin >= 0.0, "~joint_margin must not be negative");
  reader.read(servoParameters(params.servo, params.limits));
  reader.addFaults(params.servo.validate());
  reader.addFaults(params.limits.validate());
  params.lost_timeout = params.servo.lost_timeout;
  return params;
}

}  // namespace view_servo
