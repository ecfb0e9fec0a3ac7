// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace view_servo
{
/** @file Statistics of the rows of tables. All take at least one value. */

double mean(const std::vector<double>& values);

/** Standard deviation of the values themselves: the sum of squares is divided by their number. */
double deviation(const std::vector<double>& values);

/**
 * The value that this part of all values comes before in ascending order: the one with index floor(part x number of
 * values), or the last one. NaN counts as larger than any number.
 * @param part in [0, 1].
 */
double percentile(std::vector<double> values, double part);

/** The value in the middle; of an even number of values, the larger of the two there. NaN counts as in percentile(). */
double median(const std::vector<double>& values);

}  // namespace view_servo
