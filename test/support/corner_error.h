// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"

#include <Eigen/Core>
#include <opencv2/core/types.hpp>

#include <array>
#include <cmath>

namespace view_servo::test
{
/** Distances of where two homographies send the corners of an image [px]; NaN for a NaN matrix. */
inline std::array<double, 4> cornerErrors(const Eigen::Matrix3d& estimated, const Eigen::Matrix3d& truth,
                                          const cv::Size& size)
{
  std::array<double, 4> errors{};
  std::size_t i = 0;
  for (const Eigen::Vector2d& corner : cornersOf(size))
  {
    errors[i++] = (transfer(estimated, corner) - transfer(truth, corner)).norm();
  }
  return errors;
}

/** Their mean. The size is that of the pictures in textured_plane.h. */
inline double cornerError(const Eigen::Matrix3d& estimated, const Eigen::Matrix3d& truth,
                          const cv::Size& size = cv::Size(480, 360))
{
  double sum = 0.0;
  for (const double error : cornerErrors(estimated, truth, size))
  {
    sum += error;
  }
  return sum / 4.0;
}

/** The largest; NaN if any is. */
inline double largestCornerError(const Eigen::Matrix3d& estimated, const Eigen::Matrix3d& truth, const cv::Size& size)
{
  double largest = 0.0;
  for (const double error : cornerErrors(estimated, truth, size))
  {
    largest = error > largest || std::isnan(error) ? error : largest;
  }
  return largest;
}

}  // namespace view_servo::test
