// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/velocity_limiter.h"

#include "view_servo/parameters/faults.h"

namespace view_servo
{
std::vector<std::string> VelocityLimits::validate() const
{
  Faults faults;
  faults.require(max_speed > 0.0, "max_speed must be more than 0 m/s");
  faults.require(max_turn_rate > 0.0, "max_turn_rate must be more than 0 rad/s");
  faults.require(max_acceleration > 0.0, "max_acceleration must be more than 0 m/s^2");
  faults.require(max_turn_acceleration > 0.0, "max_turn_acceleration must be more than 0 rad/s^2");
  return faults.list();
}

}  // namespace view_servo
