// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>

#include <array>

namespace view_servo
{
/** @file A rectangle of pixels as points [px]. Pixels' middles have whole coordinates, so it ends at width - 1. */

/** The middles of the pixels in the four corners [px]: clockwise as seen in the image, the upper left one first. */
inline std::array<Eigen::Vector2d, 4> cornersOf(const cv::Rect& region)
{
  const double left = region.x;
  const double top = region.y;
  const double right = left + region.width - 1.0;
  const double bottom = top + region.height - 1.0;
  return { Eigen::Vector2d(left, top), Eigen::Vector2d(right, top), Eigen::Vector2d(right, bottom),
           Eigen::Vector2d(left, bottom) };
}

/** The same for the rectangle of a whole image. */
inline std::array<Eigen::Vector2d, 4> cornersOf(const cv::Size& size)
{
  return cornersOf(cv::Rect(cv::Point(), size));
}

/** The middle of the rectangle [px]. */
inline Eigen::Vector2d middleOf(const cv::Rect& region)
{
  return { region.x + 0.5 * (region.width - 1), region.y + 0.5 * (region.height - 1) };
}

}  // namespace view_servo
