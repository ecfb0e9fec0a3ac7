// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/parallax.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/significance.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
constexpr std::size_t FIRST = 25;  // so many pairs, then twice as many and so on, are judged for themselves
constexpr std::size_t SAMPLE = 2;  // determine the epipole
constexpr std::size_t FEWEST = SAMPLE + 1;

}  // namespace

Parallax::Parallax(const Eigen::Matrix3d& plane, const Correspondences& pairs, double threshold)
  : plane_(plane), threshold_(threshold)
{
  for (const Correspondence& pair : pairs)
  {
    const double distance = (transfer(plane, pair.reference) - pair.current).norm();
    if (distance >= 2.0 * threshold)
    {
      // A Sampson distance is shared by both images: in the current one alone it may be larger by the root of two.
      off_plane_.push_back({ pair, 2.0 / M_PI * std::asin(std::sqrt(2.0) * threshold / distance) });
    }
  }
}

std::vector<std::size_t> Parallax::countAgreeing(const Eigen::Matrix3d& f) const
{
  std::vector<std::size_t> counts;
  std::size_t agreeing = 0;
  std::size_t next = FIRST;
  for (std::size_t i = 0; i < off_plane_.size(); ++i)
  {
    agreeing += sampsonError(f, off_plane_[i].pair) < threshold_ * threshold_ ? 1 : 0;
    if (i + 1 == next || i + 1 == off_plane_.size())
    {
      counts.push_back(agreeing);
      next *= 2;
    }
  }
  return counts;
}

double Parallax::significance(const Eigen::Matrix3d& f) const
{
  return significance(countAgreeing(f));
}

double Parallax::significance(const std::vector<std::size_t>& agreeing) const
{
  double best = -std::numeric_limits<double>::infinity();
  double tests = 0.0;
  double chances = 0.0;
  std::size_t first = 0;
  std::size_t next = FIRST;
  for (const std::size_t agree : agreeing)
  {
    const std::size_t count = std::min(next, off_plane_.size());
    for (; first < count; ++first)
    {
      chances += off_plane_[first].chance;
    }
    next *= 2;
    if (count < FEWEST)
    {
      continue;
    }
    tests += 1.0;
    const double n = static_cast<double>(count);
    const double epipoles = n * (n - 1.0) / 2.0;
    const std::size_t others = agree - std::min(agree, SAMPLE);
    best = std::max(best, -logBinomialTail(count - SAMPLE, others, chances / n) - std::log10(epipoles));
  }
  return best - std::log10(std::max(1.0, tests));
}

std::optional<Eigen::Matrix3d> Parallax::findFundamental(int samples, Rng& rng) const
{
  if (off_plane_.size() < FEWEST)
  {
    return std::nullopt;
  }
  // On which the epipole lies: through where the plane would be seen, and where the point is seen.
  const auto line = [&](const Correspondence& pair) -> Eigen::Vector3d {
    return (plane_ * pair.reference.homogeneous()).normalized().cross(pair.current.homogeneous().normalized());
  };
  std::optional<Eigen::Matrix3d> best;
  double best_significance = -std::numeric_limits<double>::infinity();
  std::vector<std::size_t> best_agreeing;
  for (int i = 0; i < samples; ++i)
  {
    // Two of three samples are of the more trustworthy pairs.
    const std::size_t among = i % 3 == 0 ? off_plane_.size() : std::min(off_plane_.size(), 4 * FIRST);
    const Correspondence& first = off_plane_[uniformIndex(rng, among)].pair;
    const Correspondence& second = off_plane_[uniformIndex(rng, among)].pair;
    const Eigen::Vector3d epipole = line(first).cross(line(second));
    Eigen::Matrix3d cross;
    cross << 0.0, -epipole.z(), epipole.y(), epipole.z(), 0.0, -epipole.x(), -epipole.y(), epipole.x(), 0.0;
    const Eigen::Matrix3d f = (cross * plane_).normalized();
    if (!(f.norm() > 0.5))  // the same pair twice, or lines that coincide
    {
      continue;
    }
    // One with which nowhere more pairs agree is no more significant.
    std::vector<std::size_t> agreeing = countAgreeing(f);
    if (best && std::equal(agreeing.begin(), agreeing.end(), best_agreeing.begin(), std::less_equal<>()))
    {
      continue;
    }
    const double found = significance(agreeing);
    if (found > best_significance)
    {
      best_significance = found;
      best_agreeing = std::move(agreeing);
      best = f;
    }
  }
  return best;
}

std::optional<Eigen::Matrix3d> bestPlane(const Correspondences& pairs, double tolerance, Rng& rng)
{
  RansacParams params;
  params.inlier_threshold = tolerance;
  params.sampling = Sampling::UNIFORM;
  params.max_iterations = 1000;
  const auto found = ransac(HomographyEstimator(pairs), params, rng);
  return found.model ? std::optional<Eigen::Matrix3d>(found.model->h) : std::nullopt;
}

double significanceOffBestPlane(const Eigen::Matrix3d& f, const Correspondences& pairs, double threshold, Rng& rng)
{
  constexpr double SCALES[] = { 1.0, 0.5, 0.25 };  // of the threshold
  double best = -std::numeric_limits<double>::infinity();
  for (const double scale : SCALES)
  {
    const double tolerance = scale * threshold;
    Correspondences agreeing;
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(agreeing),
                 [&](const Correspondence& pair) { return sampsonError(f, pair) <= tolerance * tolerance; });
    const auto plane = bestPlane(agreeing, 2.0 * tolerance, rng);
    if (!plane)
    {
      break;
    }
    best = std::max(best, Parallax(*plane, pairs, tolerance).significance(f));
  }
  return best - std::log10(std::size(SCALES));
}

}  // namespace view_servo
