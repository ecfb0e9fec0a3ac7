// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/view_consistency.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace view_servo
{
namespace
{
using FivePoints = Eigen::Matrix<double, 2, 5>;
using Columns = Eigen::Matrix<double, 3, 4>;

/** Moves the centroid to 0 and scales to RMS distance 1. False when the points coincide or are not finite. */
bool normalize(FivePoints& points)
{
  constexpr double COINCIDENT = 1e-12;
  const Eigen::Vector2d centre = points.rowwise().mean();
  points.colwise() -= centre;
  const double rms = points.norm() / std::sqrt(5.0);
  if (!std::isfinite(rms) || !(rms > COINCIDENT * (1.0 + centre.norm())))
  {
    return false;
  }
  points /= rms;
  return true;
}

/** g_ij = (p_i - p_1).(p_j - p_1) with rows i = 2..4 and columns j = 2..5. */
Columns innerProducts(const FivePoints& points)
{
  const Eigen::Matrix<double, 2, 4> d = points.rightCols<4>().colwise() - points.col(0);
  return d.leftCols<3>().transpose() * d;
}

double det(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c)
{
  return a.cross(b).dot(c);
}

/**
 * Exact 2-means of numbers on a line: the clusters are the numbers below and from the returned value on. It leaves the
 * smallest sum of squares within, or, the same, the largest between. All from the smallest on if they do not differ.
 */
int upperClusterStart(std::vector<int> counts)
{
  std::sort(counts.begin(), counts.end());
  const double n = static_cast<double>(counts.size());
  const double total = std::accumulate(counts.begin(), counts.end(), 0.0);
  double lower_sum = 0.0;
  double best = 0.0;
  int start = counts.front();
  for (std::size_t i = 1; i < counts.size(); ++i)
  {
    lower_sum += counts[i - 1];
    const double lower = static_cast<double>(i);
    const double upper = n - lower;
    const double distance = (total - lower_sum) / upper - lower_sum / lower;
    const double between = distance * distance * lower * upper;
    if (counts[i] > counts[i - 1] && between > best)
    {
      best = between;
      start = counts[i];
    }
  }
  return start;
}

}  // namespace

double viewConstraint(const std::array<Correspondence, 5>& five)
{
  constexpr double VANISHING = 1e-10;
  constexpr double DEGENERATE = 1.0;
  FivePoints reference;
  FivePoints current;
  for (int i = 0; i < 5; ++i)
  {
    reference.col(i) = five[i].reference;
    current.col(i) = five[i].current;
  }
  if (!normalize(reference) || !normalize(current))
  {
    return DEGENERATE;
  }
  const Columns a = innerProducts(reference);
  const Columns b = innerProducts(current);
  const Eigen::Vector3d a2 = a.col(0);
  const Eigen::Vector3d a3 = a.col(1);
  const Eigen::Vector3d b2 = b.col(0);
  const Eigen::Vector3d b3 = b.col(1);
  Eigen::Vector2d rows[2];
  for (int k = 0; k < 2; ++k)
  {
    const Eigen::Vector3d ak = a.col(2 + k);
    const Eigen::Vector3d bk = b.col(2 + k);
    rows[k] = { det(b2, a3, ak) + det(a2, b3, ak) + det(a2, a3, bk),
                det(b2, b3, ak) + det(b2, a3, bk) + det(a2, b3, bk) };
    const double size =
        std::max(a2.norm(), b2.norm()) * std::max(a3.norm(), b3.norm()) * std::max(ak.norm(), bk.norm());
    const double length = rows[k].norm();
    if (!(length > VANISHING * size))
    {
      return DEGENERATE;
    }
    rows[k] /= length;
  }
  return std::min(std::abs(rows[0].x() * rows[1].y() - rows[0].y() * rows[1].x()), 1.0);
}

std::vector<Parameter> parameters(ViewConsistencyParams& params)
{
  return {
    real("consistency_threshold", params.threshold, "", "(0, 1]",
         "largest violation of the constraint by a consistent group"),
    real("consistency_increments", params.mean_increments, "", "> 0",
         "groups are drawn until a candidate was counted so often, on average"),
    integer("consistency_max_groups", params.max_groups, "", ">= 1", "groups of five drawn at most"),
  };
}

std::vector<std::string> ViewConsistencyParams::validate() const
{
  return faultsOf(*this);
}

std::vector<int> viewConsistentCandidates(const Correspondences& candidates, const ViewConsistencyParams& params,
                                          Rng& rng)
{
  std::vector<int> kept(candidates.size());
  std::iota(kept.begin(), kept.end(), 0);
  if (candidates.size() < 5)
  {
    return kept;
  }
  std::vector<int> counts(candidates.size(), 0);
  std::vector<int> group;
  std::array<Correspondence, 5> five;
  const double wanted = params.mean_increments * static_cast<double>(candidates.size());
  double increments = 0.0;
  for (int i = 0; i < params.max_groups && increments < wanted; ++i)
  {
    detail::drawDistinct(rng, candidates.size(), five.size(), group);
    std::transform(group.begin(), group.end(), five.begin(), [&](int index) { return candidates[index]; });
    if (viewConstraint(five) < params.threshold)
    {
      std::for_each(group.begin(), group.end(), [&](int index) { ++counts[index]; });
      increments += 5.0;
    }
  }
  const int start = upperClusterStart(counts);
  kept.erase(std::remove_if(kept.begin(), kept.end(), [&](int index) { return counts[index] < start; }), kept.end());
  return kept;
}

}  // namespace view_servo
