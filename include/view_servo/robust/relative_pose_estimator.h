// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/essential.h"

#include <cstddef>
#include <optional>
#include <vector>

namespace view_servo
{
/**
 * Motion between two calibrated cameras from five correspondences (points on z = 1), for ransac(). Error = squared
 * Sampson distance, in units of the points; infinite for points that would lie behind a camera.
 */
class RelativePoseEstimator
{
public:
  struct Model
  {
    RelativePose pose;
    Eigen::Matrix3d essential = Eigen::Matrix3d::Zero();  ///< pose.essential(): x_curᵀ E x_ref = 0
  };
  static constexpr int SAMPLE_SIZE = 5;

  /** Keeps a reference to `pairs`, which must outlive the estimator. */
  explicit RelativePoseEstimator(const Correspondences& pairs) : pairs_(pairs)
  {
  }

  std::size_t size() const
  {
    return pairs_.size();
  }
  bool accepts(const std::vector<int>& /*sample*/) const
  {
    return true;
  }
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const Correspondences& pairs_;
};

}  // namespace view_servo
