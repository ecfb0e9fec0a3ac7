// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace view_servo
{
namespace test
{
/** An 8-bit picture of the scene `grey(position)`, each pixel the mean over its area, as a camera sees it. */
template <typename Scene>
cv::Mat drawnPicture(const cv::Size& size, const Scene& grey)
{
  constexpr int OVER = 10;
  cv::Mat picture(size, CV_8UC1);
  for (int v = 0; v < size.height; ++v)
  {
    for (int u = 0; u < size.width; ++u)
    {
      double sum = 0.0;
      for (double dv = 0.5 / OVER - 0.5; dv < 0.5; dv += 1.0 / OVER)
      {
        for (double du = 0.5 / OVER - 0.5; du < 0.5; du += 1.0 / OVER)
        {
          sum += grey(Eigen::Vector2d(u + du, v + dv));
        }
      }
      picture.at<unsigned char>(v, u) = static_cast<unsigned char>(std::lround(sum / (OVER * OVER)));
    }
  }
  return picture;
}

/** A convex polygon; its corners are in the order in which one sees them going clockwise round it. */
using Polygon = std::vector<Eigen::Vector2d>;

inline bool isInside(const Polygon& polygon, const Eigen::Vector2d& point)
{
  for (std::size_t i = 0; i < polygon.size(); ++i)
  {
    const Eigen::Vector2d side = polygon[(i + 1) % polygon.size()] - polygon[i];
    const Eigen::Vector2d offset = point - polygon[i];
    if (side.x() * offset.y() - side.y() * offset.x() < 0.0)
    {
      return false;
    }
  }
  return true;
}

}  // namespace test
}  // namespace view_servo
