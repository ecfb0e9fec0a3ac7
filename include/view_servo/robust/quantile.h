// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * The value below which `part` of all values lie: in ascending order the one with index floor(part x number of values),
 * or the last one. NaN counts as larger than any number.
 * @param values at least one. @param part in [0, 1].
 */
inline double quantileOf(std::vector<double> values, double part)
{
  const auto index = static_cast<std::size_t>(part * static_cast<double>(values.size()));
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(std::min(index, values.size() - 1));
  std::nth_element(values.begin(), place, values.end(),
                   [](double a, double b) { return a < b || (!std::isnan(a) && std::isnan(b)); });
  return *place;
}

/** The value in the middle; of an even number of values, the larger of the two there. @param values at least one. */
inline double medianOf(std::vector<double> values)
{
  return quantileOf(std::move(values), 0.5);
}

}  // namespace view_servo
