// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_homography.h"
#include "view_servo/robust/homography_estimator.h"

#include <optional>
#include <vector>

namespace view_servo
{
/**
 * Homography of a plane (x_cur ~ H x_ref) from four lines, for ransac() (thesis 4.7.1). The error compares segments,
 * not infinite lines: it is the distance across between the segments, where they lie side by side. The thesis compares
 * the angles of lines and their distances from the origin instead, and found the thresholds for these fragile.
 */
class LineHomographyEstimator
{
public:
  using Model = HomographyEstimator::Model;
  static constexpr int SAMPLE_SIZE = 4;

  /** Keeps a reference to `pairs`, which must outlive the estimator. */
  explicit LineHomographyEstimator(const SegmentPairs& pairs) : pairs_(pairs)
  {
  }

  std::size_t size() const
  {
    return pairs_.size();
  }
  /** Refuses samples with three lines that are nearly parallel or meet nearly in a point. */
  bool accepts(const std::vector<int>& sample) const;
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  /** Mean of the squared distances in the two images [px²]; infinite for segments that do not lie side by side. */
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const SegmentPairs& pairs_;
};

}  // namespace view_servo
