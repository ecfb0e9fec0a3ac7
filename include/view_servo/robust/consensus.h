// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace view_servo
{
/** How the RANSAC loop measures what data say of a model. */
template <typename Model>
class Consensus
{
public:
  virtual ~Consensus() = default;

  /** Smaller is better; infinite as soon as the cost is seen not to be below `limit`. */
  virtual double cost(const Model& model, double limit) = 0;

  /** The data that support a model, ascending, when the threshold is taken `width` times as large. */
  virtual void findInliers(const Model& model, double width, std::vector<int>& inliers) = 0;

  /** Told the inliers of the best sample so far. */
  virtual void setBest(const std::vector<int>& /*inliers*/)
  {
  }

  /** Of a result without a model. */
  virtual double costOfNone() const = 0;
};

}  // namespace view_servo
