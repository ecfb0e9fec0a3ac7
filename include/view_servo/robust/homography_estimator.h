// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/homography.h"

#include <optional>
#include <vector>

namespace view_servo
{
/** Homography of a plane (x_cur ~ H x_ref) from four points, for ransac(); error = transfer into both images [px²]. */
class HomographyEstimator
{
public:
  /** A homography with its inverse, so that scoring many points inverts once. */
  struct Model
  {
    Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d h_inverse = Eigen::Matrix3d::Identity();
  };
  static constexpr int SAMPLE_SIZE = 4;

  /** Keeps a reference to `pairs`, which must outlive the estimator. */
  explicit HomographyEstimator(const Correspondences& pairs) : pairs_(pairs)
  {
  }

  std::size_t size() const
  {
    return pairs_.size();
  }
  /** Refuses samples with three nearly collinear points, or whose triangles change orientation. */
  bool accepts(const std::vector<int>& sample) const;
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  /** Mean of the squared transfer errors in the two images [px²]. */
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const Correspondences& pairs_;
};

}  // namespace view_servo
