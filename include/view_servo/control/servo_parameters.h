// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/parameter.h"

#include <vector>

namespace view_servo
{
/** The parameters of 2.5D servoing and of the camera's motion by name, bound to what is given, which must outlive the table. */
std::vector<Parameter> servoParameters(Servo25dParams& params, VelocityLimits& limits);

}  // namespace view_servo
