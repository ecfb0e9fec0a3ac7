// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/servo_parameters.h"

#include "view_servo/parameters/faults.h"

namespace view_servo
{
std::vector<std::string> Servo25dParams::validate() const
{
  Faults faults;
  faults.require(gain > 0.0, "gain must be more than 0 1/s");
  faults.require(near_gain >= gain, "near_gain must be at least gain");
  faults.require(margin >= 0.0 && margin <= 0.3, "margin must lie in [0, 0.3]");
  faults.require(distance > 0.0, "distance must be more than 0 m");
  faults.require(translation_tolerance > 0.0, "translation_tolerance must be more than 0 m");
  faults.require(rotation_tolerance > 0.0, "rotation_tolerance must be more than 0 rad");
  faults.require(dwell >= 0.0, "dwell must not be negative");
  faults.require(loss_tolerance >= 0.0 && loss_tolerance <= 0.5, "loss_tolerance must lie in [0, 0.5] s");
  faults.require(lost_timeout > 0.0, "lost_timeout must be more than 0 s");
  return faults.list();
}

std::vector<Parameter> servoParameters(Servo25dParams& params, VelocityLimits& limits)
{
  return {
    real("gain", params.gain, "rate at which a large error decays [1/s], > 0"),
    real("near_gain", params.near_gain, "likewise of a small one [1/s], >= gain"),
    real("margin", params.margin, "part of the image's sides that the chosen point stays out of, [0, 0.3]"),
    real("distance", params.distance, "of the plane from the view until it is known [m], > 0"),
    real("translation_tolerance", params.translation_tolerance, "of being at the view [m], > 0"),
    real("rotation_tolerance", params.rotation_tolerance, "likewise [rad], > 0"),
    real("dwell", params.dwell, "time within the tolerances [s], >= 0"),
    real("loss_tolerance", params.loss_tolerance, "without the view, bridged; then it stands [s], [0, 0.5]"),
    real("lost_timeout", params.lost_timeout, "without the view, after which it gives up [s], > 0"),
    real("max_speed", limits.max_speed, "of the camera [m/s], > 0"),
    real("max_turn_rate", limits.max_turn_rate, "[rad/s], > 0"),
    real("max_acceleration", limits.max_acceleration, "[m/s^2], > 0"),
    real("max_turn_acceleration", limits.max_turn_acceleration, "[rad/s^2], > 0"),
  };
}

}  // namespace view_servo
