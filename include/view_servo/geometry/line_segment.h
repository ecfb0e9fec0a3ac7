// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <vector>

namespace view_servo
{
/**
 * Third component of the cross product of two vectors in the plane: positive when a turns to b by 0 to +180 degrees.
 */
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b)
{
  return a.x() * b.y() - a.y() * b.x();
}

/** A line segment in an image, from `start` to `end` [px]. */
struct Segment
{
  Eigen::Vector2d start;
  Eigen::Vector2d end;

  /** Distance of the two ends [px]. */
  double length() const
  {
    return (end - start).norm();
  }
  Eigen::Vector2d midpoint() const
  {
    return 0.5 * (start + end);
  }
  /** Unit vector from start to end; NaN for a segment of no length. */
  Eigen::Vector2d direction() const
  {
    return (end - start) / length();
  }
  /**
   * Unit normal: the direction turned by +90 degrees, which is clockwise in an image with v down. In the picture it
   * points to the right of the way from start to end.
   */
  Eigen::Vector2d normal() const
  {
    const Eigen::Vector2d d = direction();
    return { -d.y(), d.x() };
  }
  /** The same segment from end to start. */
  Segment reversed() const
  {
    return { end, start };
  }
};

using Segments = std::vector<Segment>;

}  // namespace view_servo
