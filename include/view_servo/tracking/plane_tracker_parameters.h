// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/parameters/parameter.h"

#include <vector>

namespace view_servo
{
/** The parameters of following a plane by name, bound to what is given, which must outlive the table. */
std::vector<Parameter> planeTrackerParameters(PlaneTrackerParams& params);

}  // namespace view_servo
