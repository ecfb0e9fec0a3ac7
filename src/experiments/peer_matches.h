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
/** Key points of an image and their descriptors, one a row. */
struct PeerFeatures
{
  std::vector<cv::KeyPoint> points;
  cv::Mat descriptors;
};

inline PeerFeatures featuresOfPeer(const cv::Ptr<cv::Feature2D>& detector, const cv::Mat& image)
{
  PeerFeatures features;
  detector->detectAndCompute(image, cv::noArray(), features.points, features.descriptors);
  return features;
}

/**
 * Matches by OpenCV's key points and descriptors, to measure beside: the nearest descriptor of the current image, where
 * the second nearest is farther by a quarter at least (Lowe 2004).
 * @return positions in the reference image and, in the same order, in the current one [px].
 */
inline std::pair<std::vector<cv::Point2f>, std::vector<cv::Point2f>> matchesOfPeer(
    const cv::Ptr<cv::DescriptorMatcher>& matcher, const PeerFeatures& reference, const PeerFeatures& current)
{
  constexpr float RATIO = 0.8F;
  std::pair<std::vector<cv::Point2f>, std::vector<cv::Point2f>> result;
  if (reference.points.size() < 2 || current.points.size() < 2)
  {
    return result;
  }
  std::vector<std::vector<cv::DMatch>> matches;
  matcher->knnMatch(reference.descriptors, current.descriptors, matches, 2);
  for (const std::vector<cv::DMatch>& best : matches)
  {
    if (best.size() == 2 && best[0].distance < RATIO * best[1].distance)
    {
      result.first.push_back(reference.points[static_cast<std::size_t>(best[0].queryIdx)].pt);
      result.second.push_back(current.points[static_cast<std::size_t>(best[0].trainIdx)].pt);
    }
  }
  return result;
}

}  // namespace view_servo
