// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace view_servo
{
/**
 * Positions in an image: u right, v down, (0, 0) at the centre of the top-left pixel. In pixels, unless a function
 * says that it takes or gives points (x, y) on the plane z = 1 of a frame, such as level points.
 */
using Points = std::vector<Eigen::Vector2d>;

/**
 * The same physical point seen in the stored view (`reference`) and in the live image (`current`). In pixels, unless a
 * function says otherwise, as for Points.
 */
struct Correspondence
{
  Eigen::Vector2d reference;
  Eigen::Vector2d current;
};

using Correspondences = std::vector<Correspondence>;

/** Of the last fit to matched points: residuals beyond it count linearly instead of squared [px]. */
inline constexpr double FIT_HUBER_WIDTH = 0.5;

/** The pairs with the given indices, in that order. */
inline Correspondences select(const Correspondences& pairs, const std::vector<int>& indices)
{
  Correspondences selected;
  selected.reserve(indices.size());
  for (const int i : indices)
  {
    selected.push_back(pairs[static_cast<std::size_t>(i)]);
  }
  return selected;
}

}  // namespace view_servo
