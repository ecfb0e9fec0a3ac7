// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/statistics.h"

#include <cmath>
#include <numeric>

namespace view_servo
{
double mean(const std::vector<double>& values)
{
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double deviation(const std::vector<double>& values)
{
  const double centre = mean(values);
  double squares = 0.0;
  for (const double value : values)
  {
    squares += (value - centre) * (value - centre);
  }
  return std::sqrt(squares / static_cast<double>(values.size()));
}

}  // namespace view_servo
