// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>

namespace view_servo
{
/** Stands for a quantity that is not known. */
inline constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

/** One degree [rad]: an angle of five degrees is 5.0 * DEGREE. */
inline constexpr double DEGREE = M_PI / 180.0;

/** The degrees of one radian: an angle in degrees is radians * DEGREES. */
inline constexpr double DEGREES = 180.0 / M_PI;

}  // namespace view_servo
