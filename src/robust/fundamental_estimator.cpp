// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/fundamental_estimator.h"

#include "view_servo/robust/view_consistency.h"

#include <array>

namespace view_servo
{
bool FundamentalEstimator::accepts(const std::vector<int>& sample) const
{
  if (!(view_consistency_threshold_ > 0.0))
  {
    return true;
  }
  const auto consistent = [&](std::size_t first) {
    std::array<Correspondence, 5> five;
    for (std::size_t i = 0; i < five.size(); ++i)
    {
      five[i] = pairs_[sample[first + i]];
    }
    return viewConstraint(five) <= view_consistency_threshold_;
  };
  return consistent(0) && consistent(SAMPLE_SIZE - 5);
}

void FundamentalEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  const std::vector<Model> solutions = fundamentalFromSevenPoints(select(pairs_, sample));
  models.insert(models.end(), solutions.begin(), solutions.end());
}

double FundamentalEstimator::error(const Model& model, std::size_t i) const
{
  return sampsonError(model, pairs_[i]);
}

std::optional<FundamentalEstimator::Model> FundamentalEstimator::refit(const Model& /*model*/,
                                                                       const std::vector<int>& inliers) const
{
  constexpr int ITERATIONS = 5;
  const Correspondences pairs = select(pairs_, inliers);
  const auto linear = fundamentalFromPoints(pairs);
  if (!linear)
  {
    return std::nullopt;
  }
  return refineFundamental(*linear, pairs, std::numeric_limits<double>::infinity(), ITERATIONS);
}

}  // namespace view_servo
