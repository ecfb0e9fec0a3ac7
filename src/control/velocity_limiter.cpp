// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/velocity_limiter.h"

#include "view_servo/parameters/faults.h"

namespace view_servo
{
std::vector<Parameter> parameters(VelocityLimits& params)
{
  return {
    real("max_speed", params.max_speed, "m/s", "> 0", "largest speed"),
    real("max_turn_rate", params.max_turn_rate, "rad/s", "> 0", "largest turn rate"),
    real("max_acceleration", params.max_acceleration, "m/s^2", "> 0",
         "largest rate at which the velocity changes, but for a stop"),
    real("max_turn_acceleration", params.max_turn_acceleration, "rad/s^2", "> 0",
         "largest rate at which the turn rate changes, but for a stop"),
  };
}

std::vector<std::string> VelocityLimits::validate() const
{
  return faultsOf(*this);
}

}  // namespace view_servo
