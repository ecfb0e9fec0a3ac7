// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/velocity_limiter.h"

#include "view_servo/geometry/faults.h"

#include <algorithm>

namespace view_servo
{
namespace
{
/** The factor that brings a velocity within limits, at most 1. */
double scaleWithin(const BaseVelocity& velocity, double linear, double angular)
{
  const double excess = std::max(velocity.head<2>().norm() / linear, std::abs(velocity.z()) / angular);
  return excess > 1.0 ? 1.0 / excess : 1.0;
}

}  // namespace

std::vector<std::string> BaseLimits::validate() const
{
  Faults faults;
  faults.require(max_speed > 0.0, "max_speed must be more than 0 m/s");
  faults.require(max_turn_rate > 0.0, "max_turn_rate must be more than 0 rad/s");
  faults.require(max_acceleration > 0.0, "max_acceleration must be more than 0 m/s^2");
  faults.require(max_turn_acceleration > 0.0, "max_turn_acceleration must be more than 0 rad/s^2");
  return faults.list();
}

BaseVelocity VelocityLimiter::next(const BaseVelocity& wanted, double dt)
{
  if (!wanted.allFinite())
  {
    velocity_.setZero();
    return velocity_;
  }
  if (!(dt > 0.0))
  {
    return velocity_;
  }
  const BaseVelocity allowed = scaleWithin(wanted, limits_.max_speed, limits_.max_turn_rate) * wanted;
  const BaseVelocity change = allowed - velocity_;
  velocity_ += scaleWithin(change, dt * limits_.max_acceleration, dt * limits_.max_turn_acceleration) * change;
  return velocity_;
}

}  // namespace view_servo
