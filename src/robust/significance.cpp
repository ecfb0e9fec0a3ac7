// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/significance.h"

#include <algorithm>
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

double logBinomialTail(std::size_t count, std::size_t successes, double probability)
{
  constexpr double LEAST = 1e-9;
  const double n = static_cast<double>(count);
  const double p = std::max(probability, LEAST);
  const double share = static_cast<double>(successes) / std::max(1.0, n);
  if (share <= p)
  {
    return 0.0;
  }
  const double rest = share < 1.0 ? (1.0 - share) * std::log10((1.0 - share) / (1.0 - p)) : 0.0;
  return -n * (share * std::log10(share / p) + rest);
}

}  // namespace view_servo
