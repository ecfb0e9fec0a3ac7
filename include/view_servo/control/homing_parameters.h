// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/parameter.h"

#include <vector>

namespace view_servo
{
/** The parameters of homing and of the base it drives by name, bound to what is given, which must outlive the table. */
std::vector<Parameter> homingParameters(HomingParams& params, VelocityLimits& limits);

}  // namespace view_servo
