// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/ransac.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace view_servo
{
std::vector<std::string> RansacParams::validate() const
{
  std::vector<std::string> faults;
  const auto require = [&faults](bool condition, const char* fault) {
    if (!condition)
    {
      faults.emplace_back(fault);
    }
  };
  require(inlier_threshold > 0.0 && std::isfinite(inlier_threshold), "inlier_threshold must be positive and finite");
  require(confidence > 0.0 && confidence < 1.0, "ransac_confidence must be between 0 and 1, both excluded");
  require(min_iterations >= 0, "ransac_min_iterations must not be negative");
  require(max_iterations >= 1, "ransac_max_iterations must be at least 1");
  require(max_rejected >= 0, "ransac_max_rejected must not be negative");
  require(local_optimizations >= 0, "local_optimizations must not be negative");
  require(sampling == Sampling::UNIFORM || sampling == Sampling::PROGRESSIVE,
          "sampling must be UNIFORM or PROGRESSIVE");
  return faults;
}

namespace detail
{
std::vector<int> randomOrder(Rng& rng, std::size_t count)
{
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  for (std::size_t i = count; i > 1; --i)
  {
    std::swap(order[i - 1], order[uniformIndex(rng, i)]);
  }
  return order;
}

void SequentialTest::setBest(double inlier_ratio)
{
  constexpr double FAILING = 0.25;
  constexpr double MAX_RATIO = 0.99;  // keeps the evidence of one outlier finite
  const double good = std::min(inlier_ratio, MAX_RATIO);
  inlier_evidence_ = good > 0.0 ? std::log(FAILING) : 0.0;
  outlier_evidence_ = std::log((1.0 - FAILING * good) / (1.0 - good));
}

double requiredSamples(double inlier_ratio, int sample_size, double confidence)
{
  const double outlier_free = std::pow(inlier_ratio, sample_size);
  return std::log1p(-confidence) / std::log1p(-outlier_free);  // 0 / inf at a ratio of 1, -x / -0 = inf at 0
}

}  // namespace detail

}  // namespace view_servo
