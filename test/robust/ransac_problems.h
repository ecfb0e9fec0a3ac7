// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/synthetic_scene.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace view_servo
{
/** @file Problems for the RANSAC loop: lines in a plane, and scenes that two cameras see. */

constexpr double INFINITE = std::numeric_limits<double>::infinity();

/** A line through two points, n^T x = c with unit n; counts what it is asked. */
class LineEstimator
{
public:
  struct Model
  {
    Eigen::Vector2d normal;
    double offset;
  };
  static constexpr int SAMPLE_SIZE = 2;

  explicit LineEstimator(const Points& points) : points_(points)
  {
  }

  std::size_t size() const
  {
    return points_.size();
  }

  bool accepts(const std::vector<int>& sample) const
  {
    return acceptance(sample);
  }

  void solve(const std::vector<int>& sample, std::vector<Model>& models) const
  {
    samples.push_back(sample);
    const Eigen::Vector2d d = points_[sample[1]] - points_[sample[0]];
    if (d.norm() > 0.0)
    {
      const Eigen::Vector2d normal = Eigen::Vector2d(-d.y(), d.x()).normalized();
      models.push_back({ normal, normal.dot(points_[sample[0]]) });
    }
  }

  double error(const Model& model, std::size_t i) const
  {
    const double distance = model.normal.dot(points_[i]) - model.offset;
    return distance * distance;
  }

  /** Total least squares. */
  std::optional<Model> refit(const Model& /*model*/, const std::vector<int>& inliers) const
  {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const int i : inliers)
    {
      centre += points_[i] / static_cast<double>(inliers.size());
    }
    double xx = 0.0;
    double xy = 0.0;
    double yy = 0.0;
    for (const int i : inliers)
    {
      const Eigen::Vector2d d = points_[i] - centre;
      xx += d.x() * d.x();
      xy += d.x() * d.y();
      yy += d.y() * d.y();
    }
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
    const Eigen::Vector2d normal(-std::sin(angle), std::cos(angle));
    return Model{ normal, normal.dot(centre) };
  }

  bool (*acceptance)(const std::vector<int>&) = [](const std::vector<int>&) {
    return true;
  };
  mutable std::vector<std::vector<int>> samples;  ///< all that were solved

private:
  const Points& points_;
};

/** Points within `noise` (deviation) of y = 0.5 x + 40 first, then points all over a 640 x 480 image. */
inline Points linePoints(int inliers, int outliers, double noise, std::uint64_t seed)
{
  Rng rng(seed);
  Points points;
  for (int i = 0; i < inliers; ++i)
  {
    const double x = uniform(rng, 0.0, 640.0);
    points.emplace_back(x, 0.5 * x + 40.0 + noise * gaussian(rng));
  }
  for (int i = 0; i < outliers; ++i)
  {
    points.push_back(test::randomPixel(rng));
  }
  return points;
}

inline RansacParams uniformParams()
{
  RansacParams params;
  params.sampling = Sampling::UNIFORM;
  return params;
}

inline test::Scene makeScene(bool planar, int inliers, int outliers, double noise, std::uint64_t seed,
                             bool shuffle = true)
{
  Rng rng(seed);
  test::SceneOptions options;
  options.planar = planar;
  options.inliers = inliers;
  options.outliers = outliers;
  options.noise = noise;
  options.shuffle = shuffle;
  return test::makeScene(options, rng);
}

inline int trueInliers(const std::vector<int>& inliers, const test::Scene& scene)
{
  return static_cast<int>(
      std::count_if(inliers.begin(), inliers.end(), [&](int i) { return static_cast<bool>(scene.is_inlier[i]); }));
}

}  // namespace view_servo
