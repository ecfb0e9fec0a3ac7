// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace view_servo
{
/** @file Statistics of the rows of tables. All take at least one value. */

/** Arithmetic mean. */
double mean(const std::vector<double>& values);

/** Standard deviation of the values themselves: the sum of squares is divided by their number. */
double deviation(const std::vector<double>& values);

}  // namespace view_servo
