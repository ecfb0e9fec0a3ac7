// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include <cstddef>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * Matches by OpenCV's key points and descriptors, to measure beside: the nearest descriptor of the current image, where the
 * second nearest is farther by a quarter at least (Lowe 2004).
 * @return positions in the reference image and, in the same order, in the current one [px].
 */
inline std::pair<std::vector<cv::Point2f>, std::vector<cv::Point2f>> matchesOfPeer(
    const cv::Ptr<cv::Feature2D>& detector, const cv::Ptr<cv::DescriptorMatcher>& matcher, const cv::Mat& reference,
    const cv::Mat& current)
{
  constexpr float RATIO = 0.8F;
  std::vector<cv::KeyPoint> reference_points;
  std::vector<cv::KeyPoint> current_points;
  cv::Mat reference_descriptors;
  cv::Mat current_descriptors;
  detector->detectAndCompute(reference, cv::noArray(), reference_points, reference_descriptors);
  detector->detectAndCompute(current, cv::noArray(), current_points, current_descriptors);
  std::pair<std::vector<cv::Point2f>, std::vector<cv::Point2f>> result;
  if (reference_points.size() < 2 || current_points.size() < 2)
  {
    return result;
  }
  std::vector<std::vector<cv::DMatch>> matches;
  matcher->knnMatch(reference_descriptors, current_descriptors, matches, 2);
  for (const std::vector<cv::DMatch>& best : matches)
  {
    if (best.size() == 2 && best[0].distance < RATIO * best[1].distance)
    {
      result.first.push_back(reference_points[static_cast<std::size_t>(best[0].queryIdx)].pt);
      result.second.push_back(current_points[static_cast<std::size_t>(best[0].trainIdx)].pt);
    }
  }
  return result;
}

}  // namespace view_servo
