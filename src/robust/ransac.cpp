// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/ransac.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace view_servo
{
std::vector<Parameter> parameters(RansacParams& params)
{
  return {
    real("inlier_threshold", params.inlier_threshold, "px", "> 0", "largest error of an inlier"),
    real("ransac_confidence", params.confidence, "", "(0, 1)", "wanted probability of an outlier-free sample"),
    integer("ransac_min_iterations", params.min_iterations, "", ">= 0", "samples drawn at least"),
    integer("ransac_max_iterations", params.max_iterations, "", ">= 1", "samples drawn at most"),
    integer("ransac_max_rejected", params.max_rejected, "", ">= 0", "samples that a cheap test may refuse"),
    integer("local_optimizations", params.local_optimizations, "", ">= 0", "refits of a new best model, 0 = off"),
    boolean("improvement_stage", params.improvement_stage, "exchange each datum of the best sample in turn"),
  };
}

std::vector<std::string> RansacParams::validate() const
{
  std::vector<std::string> faults = faultsOf(*this);
  if (sampling != Sampling::UNIFORM && sampling != Sampling::PROGRESSIVE)
  {
    faults.emplace_back("sampling must be UNIFORM or PROGRESSIVE");
  }
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
