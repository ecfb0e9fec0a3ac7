// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

#include <limits>
#include <string>

namespace view_servo::check
{
/** What can be said of a camera's picture by itself. */
struct PictureMeasures
{
  std::string lack_of_light;                                     ///< see lackOfLight(); empty: there is enough
  double brightness = 0.0;                                       ///< mean [grey levels]
  double overexposed = 0.0;                                      ///< part of the pixels that are white
  double edge_width = std::numeric_limits<double>::quiet_NaN();  ///< see edgeWidth() [px]; NaN: it shows no edges
  int corners = 0;                                               ///< number of corners
  int segments = 0;                                              ///< number of line segments
};

/**
 * How blurred the edges of a picture are: the median of the standard deviations of the Gaussians that would make them
 * of steps [px]. Noise hardly matters, as only places of much contrast count.
 * @param grey 8-bit, one channel. @return NaN when there are too few edges to tell.
 */
double edgeWidth(const cv::Mat& grey);

/**
 * Measures a picture; its corners and segments are those that the nodes find by their default parameters. @param grey
 * 8-bit, one channel.
 */
PictureMeasures measurePicture(const cv::Mat& grey);

/** The picture, BGR, with its corners as dots and its segments as lines, and a line of text below. */
cv::Mat drawPicture(const cv::Mat& grey, const std::string& text);

}  // namespace view_servo::check
