// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "odometry_scale.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace view_servo
{
std::optional<OdometryScale> scaleByOdometry(const std::vector<MeasuredWay>& ways, double apart)
{
  double squared_way = 0.0;
  double squared_change = 0.0;
  double change_by_way = 0.0;
  double farthest = 0.0;
  for (std::size_t i = 0; i < ways.size(); ++i)
  {
    for (std::size_t j = 0; j < i; ++j)
    {
      const Eigen::Isometry3d moved = ways[i].camera_in_odom.inverse() * ways[j].camera_in_odom;
      const Eigen::Vector3d change = ways[i].translation - moved.linear() * ways[j].translation;
      squared_way += moved.translation().squaredNorm();
      squared_change += change.squaredNorm();
      change_by_way += change.dot(moved.translation());
      farthest = std::max(farthest, moved.translation().norm());
    }
  }
  if (!(farthest >= apart) || !(change_by_way > 0.0))
  {
    return std::nullopt;
  }
  OdometryScale scale;
  scale.metres = squared_way / change_by_way;
  // Over all pairs, the sum of squared differences is the number of ways times the sum of squares about their mean, so
  // that the estimate is a regression's over the ways themselves: 3 residuals each, less what the mean and the scale took.
  const auto count = static_cast<double>(ways.size());
  const double residuals = std::max(0.0, squared_change - change_by_way / scale.metres) / count;
  const double variance = residuals / std::max(1.0, 3.0 * count - 4.0);
  scale.relative_deviation = scale.metres * std::sqrt(variance * count / squared_way);
  return scale;
}

}  // namespace view_servo
