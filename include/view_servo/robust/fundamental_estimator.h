// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/fundamental.h"

#include <optional>
#include <vector>

namespace view_servo
{
/** Fundamental matrix (x_curᵀ F x_ref = 0) from seven points, for ransac(); error = squared Sampson distance [px²]. */
class FundamentalEstimator
{
public:
  using Model = Eigen::Matrix3d;
  static constexpr int SAMPLE_SIZE = 7;

  /**
   * Keeps a reference to `pairs`, which must outlive the estimator.
   * @param view_consistency_threshold samples are refused when viewConstraint() of their first or last five points is
   * larger (thesis 6.3, method 2); 0: no such test.
   */
  explicit FundamentalEstimator(const Correspondences& pairs, double view_consistency_threshold = 0.0)
    : pairs_(pairs), view_consistency_threshold_(view_consistency_threshold)
  {
  }

  std::size_t size() const
  {
    return pairs_.size();
  }
  bool accepts(const std::vector<int>& sample) const;
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const Correspondences& pairs_;
  double view_consistency_threshold_;
};

}  // namespace view_servo
