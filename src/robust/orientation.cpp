// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/orientation.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b)
{
  return a.x() * b.y() - a.y() * b.x();
}

/** Positive when the triangle of a point and two of its neighbours turns the same way in both images; 0: none tells. */
double sameTurn(const Correspondence& point, const std::vector<const Correspondence*>& neighbours)
{
  constexpr double LEAST_SINE = 0.3;
  for (std::size_t k = 1; k < neighbours.size(); ++k)
  {
    const Eigen::Vector2d first = neighbours[0]->reference - point.reference;
    const Eigen::Vector2d second = neighbours[k]->reference - point.reference;
    const double turn = cross(first, second);
    if (std::abs(turn) >= LEAST_SINE * first.norm() * second.norm())
    {
      return turn * cross(neighbours[0]->current - point.current, neighbours[k]->current - point.current);
    }
  }
  return 0.0;
}

}  // namespace

bool keepsOrientation(const Correspondences& pairs, double part)
{
  constexpr std::size_t MOST_POINTS = 400;
  constexpr std::size_t MOST_NEIGHBOURS = 12;
  constexpr double APART = 6.0;  // nearer ones may be the same point, matched again [px]
  const std::size_t points = std::min(MOST_POINTS, pairs.size());
  std::size_t kept = 0;
  std::size_t reversed = 0;
  std::vector<std::pair<double, const Correspondence*>> others;
  std::vector<const Correspondence*> neighbours;
  for (std::size_t i = 0; i < points; ++i)
  {
    const Correspondence& point = pairs[i * pairs.size() / points];
    others.clear();
    for (const Correspondence& other : pairs)
    {
      const double squared = (other.reference - point.reference).squaredNorm();
      if (squared >= APART * APART)
      {
        others.emplace_back(squared, &other);
      }
    }
    const std::size_t most = std::min(MOST_NEIGHBOURS, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(most), others.end());
    neighbours.clear();
    for (std::size_t k = 0; k < most; ++k)
    {
      neighbours.push_back(others[k].second);
    }
    const double same = sameTurn(point, neighbours);
    kept += same > 0.0 ? 1 : 0;
    reversed += same < 0.0 ? 1 : 0;
  }
  return static_cast<double>(kept) > part * static_cast<double>(kept + reversed);
}

}  // namespace view_servo
