// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace view_servo
{
/** How the RANSAC loop measures the support of a model by the data. */
template <typename Model>
class Consensus
{
public:
  virtual ~Consensus() = default;

  /**
   * Cost of a model, the smaller the better. May return infinity as soon as it is certain, or nearly certain, that the
   * cost is not below `limit`; with a limit of infinity the cost is exact.
   */
  virtual double cost(const Model& model, double limit) = 0;

  /**
   * Sets `inliers` to the indices of the data that support a model, ascending, with the inlier threshold multiplied by
   * `width`.
   */
  virtual void findInliers(const Model& model, double width, std::vector<int>& inliers) = 0;

  /** Called with the inliers of each new best sample, by which later models can be rejected sooner. */
  virtual void setBest(const std::vector<int>& /*inliers*/)
  {
  }

  /** RansacResult::cost where no model was found. */
  virtual double costOfNone() const = 0;
};

}  // namespace view_servo
