// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <string>
#include <vector>

namespace view_servo
{
/** Options of the edge detector (thesis 2.8.1; Canny 1986). */
struct EdgeParams
{
  double sigma = 1.0;           ///< Gaussian derivative scale [px]
  double low_threshold = 2.0;   ///< least gradient of every pixel of a chain [grey levels/px]
  double high_threshold = 4.0;  ///< at least one pixel of a chain has this gradient [grey levels/px]
  int min_points = 5;           ///< least number of pixels of a chain that is kept

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(EdgeParams& params);

/** The rows of these three parameters, which EdgeParams and LineSegmentParams share. */
std::vector<Parameter> edgeParameters(double& sigma, double& low_threshold, double& high_threshold);

/**
 * Points of an edge one after the other, with the brighter side on the left of somebody who walks along them and looks
 * at the image: sub-pixel positions [px], (0, 0) at the centre of the top-left pixel. The last point of a closed edge
 * is its first, the one farthest from its middle: on a polygon, a corner.
 */
using EdgeChain = std::vector<Eigen::Vector2d>;

/**
 * The edges of an image, except in its outermost two pixels. Where several edges meet, those end that do not continue
 * smoothly. White noise of deviation s makes gradients of deviation s / (5 sigma²) in u and in v: with a high threshold
 * of four times that it makes few edges.
 * @param grey 8-bit, one channel.
 * @param region where edges are wanted: those of the whole image, cut off at its limits; empty = everywhere.
 * @throws std::invalid_argument when the image has the wrong type.
 */
std::vector<EdgeChain> detectEdges(const cv::Mat& grey, const EdgeParams& params, const cv::Rect& region = cv::Rect());

}  // namespace view_servo
