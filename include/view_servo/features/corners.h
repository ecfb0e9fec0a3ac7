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
/** Options of the Harris detector (thesis 2.7; eq. 2.20-2.24). */
struct CornerParams
{
  int max_corners = 500;            ///< at most this many corners are returned, the strongest
  double derivative_sigma = 0.7;    ///< Gaussian derivative scale [px]
  double integration_sigma = 1.4;   ///< Gaussian window of the second-moment matrix [px]
  double k = 0.04;                  ///< weight of the trace in the Harris measure R = det(M) - k tr(M)²
  double min_distance = 2.0;        ///< no two corners closer than this [px]
  double relative_threshold = 0.0;  ///< least response of a corner that is kept, as a fraction of the strongest, [0, 1)
  int border = 4;                   ///< no corners nearer to the image's border, to the pixel [px]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(CornerParams& params);

/** A corner: sub-pixel position [px], (0, 0) at the centre of the top-left pixel. */
struct Corner
{
  Eigen::Vector2d position;  ///< [px]
  float response;            ///< Harris measure R of eq. 2.24 [(grey levels / px)⁴]
};

/**
 * Harris corners, strongest first: 8-way local maxima of R > 0, each refined by a quadratic fit to its 3x3
 * neighbourhood.
 * @param image 8-bit, one channel.
 * @param mask 8-bit, same size, non-zero where corners are wanted; empty = everywhere.
 * @throws std::invalid_argument when the image or the mask has the wrong type or size.
 */
std::vector<Corner> detectCorners(const cv::Mat& image, const CornerParams& params, const cv::Mat& mask = cv::Mat());

}  // namespace view_servo
