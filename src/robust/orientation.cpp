// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/orientation.h"

#include <Eigen/Core>

#include <cstddef>
#include <limits>

namespace view_servo
{
bool keepsOrientation(const Correspondences& pairs)
{
  int kept = 0;
  int reversed = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    // The two nearest in the reference.
    std::size_t near[2] = { i, i };
    double distance[2] = { std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity() };
    for (std::size_t j = 0; j < pairs.size(); ++j)
    {
      const double squared = (pairs[j].reference - pairs[i].reference).squaredNorm();
      if (j == i || squared >= distance[1])
      {
        continue;
      }
      const std::size_t place = squared < distance[0] ? 0 : 1;
      if (place == 0)
      {
        near[1] = near[0];
        distance[1] = distance[0];
      }
      near[place] = j;
      distance[place] = squared;
    }
    const auto twice_area = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
      return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
    };
    const double product = twice_area(pairs[i].reference, pairs[near[0]].reference, pairs[near[1]].reference) *
                           twice_area(pairs[i].current, pairs[near[0]].current, pairs[near[1]].current);
    kept += product > 0.0 ? 1 : 0;
    reversed += product < 0.0 ? 1 : 0;
  }
  return kept > reversed;
}

}  // namespace view_servo
