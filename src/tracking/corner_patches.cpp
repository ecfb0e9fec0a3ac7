// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "corner_patches.h"

#include "view_servo/features/corners.h"
#include "view_servo/parameters/faults.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

namespace view_servo
{
std::vector<cv::Mat> pyramidOf(const cv::Mat& image, int levels)
{
  constexpr int LEAST_SIDE = 40;  // [px]
  std::vector<cv::Mat> pyramid{ image };
  while (static_cast<int>(pyramid.size()) < levels &&
         std::min(pyramid.back().rows, pyramid.back().cols) >= 2 * LEAST_SIDE)
  {
    cv::Mat next;
    cv::pyrDown(pyramid.back(), next);
    pyramid.push_back(next);
  }
  return pyramid;
}

/** cv::pyrDown() takes every second pixel, from the first. */
Eigen::Matrix3d toLevel(int level)
{
  const double scale = std::ldexp(1.0, -level);
  return Eigen::Vector3d(scale, scale, 1.0).asDiagonal();
}

cv::Rect checkedRegion(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
{
  requireNoFaults("parameters of the homography aligner", params.validate());
  if (reference.empty() || reference.type() != CV_8UC1)
  {
    throw std::invalid_argument("the stored view is not an 8-bit grey image");
  }
  const cv::Rect all(0, 0, reference.cols, reference.rows);
  const cv::Rect used = region.empty() ? all : region;
  if ((used & all) != used)
  {
    throw std::invalid_argument("the region of interest leaves the stored view");
  }
  return used;
}

Points findCorners(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
{
  constexpr double SPREAD = 0.5;  // of the distance that corners on a grid would have
  cv::Mat mask(reference.size(), CV_8UC1, cv::Scalar(0));
  mask(region).setTo(255);
  CornerParams corners;
  corners.max_corners = params.max_points;
  corners.min_distance = SPREAD * std::sqrt(static_cast<double>(region.area()) / params.max_points);
  corners.border = params.patch_radius + 2;
  Points points;
  for (const Corner& corner : detectCorners(reference, corners, mask))
  {
    points.push_back(corner.position);
  }
  if (static_cast<int>(points.size()) < params.min_supporting)
  {
    throw std::invalid_argument("the stored view has " + std::to_string(points.size()) + " corners to track, " +
                                std::to_string(params.min_supporting) + " are needed");
  }
  return points;
}

std::vector<std::vector<Patch>> patchesOf(const cv::Mat& reference, const Points& points,
                                          const HomographyAlignerParams& params)
{
  constexpr int COARSE_RADIUS = 6;  // [px]
  std::vector<std::vector<Patch>> patches;
  const std::vector<cv::Mat> pyramid = pyramidOf(reference, params.levels);
  for (std::size_t level = 0; level < pyramid.size(); ++level)
  {
    const double scale = std::ldexp(1.0, -static_cast<int>(level));
    const int radius = level == 0 ? params.patch_radius : std::min(params.patch_radius, COARSE_RADIUS);
    std::vector<Patch> of_level;
    for (const Eigen::Vector2d& point : points)
    {
      of_level.push_back(makePatch(pyramid[level], scale * point, radius));
    }
    patches.push_back(std::move(of_level));
  }
  return patches;
}

}  // namespace view_servo
