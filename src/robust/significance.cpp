// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/significance.h"

#include <cmath>

namespace view_servo
{
namespace
{
double log10Choose(double n, double k)
{
  return (std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0)) / std::log(10.0);
}

}  // namespace

double logSignificance(std::size_t candidates, std::size_t inliers, int sample_size, double probability)
{
  if (inliers <= static_cast<std::size_t>(sample_size))
  {
    return 0.0;
  }
  const double n = static_cast<double>(candidates);
  const double k = static_cast<double>(inliers);
  const double log_false_alarms = std::log10(n - sample_size) + log10Choose(n, k) + log10Choose(k, sample_size) +
                                  (k - sample_size) * std::log10(probability);
  return -log_false_alarms;
}

}  // namespace view_servo
