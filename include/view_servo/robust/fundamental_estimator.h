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

/**
 * The last fit to pairs that agree with a fundamental matrix within a few pixels. Some of these may be wrong, and
 * where the right ones hold the matrix weakly, as before two planes, even one of them can tilt it while all stay
 * within a threshold. So fits to parts of the pairs, drawn at random, compete by how near most pairs come to them, at
 * several scales at once (as in MAGSAC, Barath et al. 2019), and the best is refined over the pairs within three
 * standard deviations, by the median.
 * @param huber_width Sampson distances beyond it count linearly instead of squared [px]. @return `matrix` when nothing
 * is better.
 */
Eigen::Matrix3d polishFundamental(const Eigen::Matrix3d& matrix, const Correspondences& pairs, double huber_width);

}  // namespace view_servo
