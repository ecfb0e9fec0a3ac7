// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/fundamental_estimator.h"

#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/view_consistency.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
/** Sum over the pairs and some scales of the squared distances in that scale, at most 1 each. */
double costAtAllScales(const Eigen::Matrix3d& matrix, const Correspondences& pairs)
{
  double cost = 0.0;
  for (const Correspondence& pair : pairs)
  {
    const double error = sampsonError(matrix, pair);
    for (const double scale : { 2.0, 1.0, 0.5, 0.25 })  // [px]
    {
      cost += std::min(error / (scale * scale), 1.0);
    }
  }
  return cost;
}

/**
 * Whether all pairs can lie in front of both cameras: the epipolar line of each points the same way as the line from
 * the epipole to its point (Chum, Werner & Matas 2004). Most samples with an outlier fail.
 */
bool hasOneOrientation(const Eigen::Matrix3d& f, const Correspondences& pairs)
{
  const Eigen::Vector3d epipole = currentEpipole(f);
  int positive = 0;
  for (const Correspondence& pair : pairs)
  {
    const Eigen::Vector3d line = f * pair.reference.homogeneous();
    positive += line.dot(epipole.cross(pair.current.homogeneous())) > 0.0 ? 1 : 0;
  }
  return positive == 0 || positive == static_cast<int>(pairs.size());
}

/** Those within three standard deviations, which the median distance tells. */
Correspondences nearest(const Eigen::Matrix3d& matrix, const Correspondences& pairs)
{
  constexpr double DEVIATIONS = 3.0 * 1.4826;  // of normally distributed distances, in medians of their sizes
  constexpr double NOISE = 0.3;                // pairs this near are always good enough [px]
  std::vector<double> distances;
  distances.reserve(pairs.size());
  for (const Correspondence& pair : pairs)
  {
    distances.push_back(std::sqrt(sampsonError(matrix, pair)));
  }
  const double reach = std::max(DEVIATIONS * medianOf(distances), NOISE);
  Correspondences kept;
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    if (distances[i] <= reach)
    {
      kept.push_back(pairs[i]);
    }
  }
  return kept;
}

}  // namespace

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
  const Correspondences pairs = select(pairs_, sample);
  for (const Model& solution : fundamentalFromSevenPoints(pairs))
  {
    if (hasOneOrientation(solution, pairs))
    {
      models.push_back(solution);
    }
  }
}

double FundamentalEstimator::error(const Model& model, std::size_t i) const
{
  return sampsonError(model, pairs_[i]);
}

std::optional<FundamentalEstimator::Model> FundamentalEstimator::refit(const Model& /*model*/,
                                                                       const std::vector<int>& inliers) const
{
  constexpr int ITERATIONS = 2;
  const Correspondences pairs = select(pairs_, inliers);
  const auto linear = fundamentalFromPoints(pairs);
  if (!linear)
  {
    return std::nullopt;
  }
  return refineFundamental(*linear, pairs, std::numeric_limits<double>::infinity(), ITERATIONS);
}

Eigen::Matrix3d polishFundamental(const Eigen::Matrix3d& matrix, const Correspondences& pairs, double huber_width)
{
  constexpr int DRAWS = 50;
  constexpr std::size_t DRAWN = 14;
  constexpr int ROUNDS = 2;
  Eigen::Matrix3d best = refineFundamental(matrix, pairs, huber_width);
  if (pairs.size() < 2 * DRAWN)
  {
    return best;
  }
  double best_cost = costAtAllScales(best, pairs);
  const auto compete = [&](const Eigen::Matrix3d& candidate) {
    const double cost = costAtAllScales(candidate, pairs);
    if (cost < best_cost)
    {
      best = candidate;
      best_cost = cost;
    }
  };
  Rng rng(1);
  Correspondences drawn(DRAWN);
  for (int draw = 0; draw < DRAWS; ++draw)
  {
    for (Correspondence& pair : drawn)
    {
      pair = pairs[uniformIndex(rng, pairs.size())];
    }
    if (const auto candidate = fundamentalFromPoints(drawn))
    {
      compete(*candidate);
    }
  }
  for (int round = 0; round < ROUNDS; ++round)
  {
    compete(refineFundamental(best, nearest(best, pairs), huber_width));
  }
  return best;
}

}  // namespace view_servo
