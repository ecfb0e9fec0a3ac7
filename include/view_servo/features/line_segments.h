// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"
#include "view_servo/parameters/parameter.h"

#include <opencv2/core/mat.hpp>

#include <string>
#include <vector>

namespace view_servo
{
enum class SegmentDetector
{
  CANNY,  ///< edge chains, subdivided (thesis 2.8)
  LSD     ///< OpenCV's Line Segment Detector (von Gioi et al. 2010)
};

/** Whether this OpenCV has a Line Segment Detector: versions 4.1.0 to 4.5.3 have none. */
bool lsdAvailable();

/** Options of the detection of line segments. */
struct LineSegmentParams
{
  SegmentDetector detector = SegmentDetector::CANNY;
  double sigma = 1.0;              ///< scale of the edges [px]: about 1 for fine, 2 for coarse ones
  double low_threshold = 2.0;      ///< CANNY: see EdgeParams [grey levels/px]
  double high_threshold = 4.0;     ///< CANNY: see EdgeParams [grey levels/px]
  double min_deviation = 0.6;      ///< CANNY: smaller deviations from a straight line are noise [px]
  double max_deviation = 0.8;      ///< CANNY: no segment deviates more from its edge [px]
  double min_significance = 20.0;  ///< CANNY: least ratio of a segment's length to its greatest deviation
  double min_length = 15.0;        ///< shorter segments are left out [px]
  int max_segments = 1000;         ///< the longest are kept

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LineSegmentParams& params);

/**
 * The line segments of an image, longest first, each directed by its contrast: the brighter side is on the left of
 * somebody who walks from start to end and looks at the image, -normal().
 * @param grey 8-bit, one channel.
 * @param region where segments are wanted; empty = everywhere.
 * @throws std::invalid_argument when the image has the wrong type, std::runtime_error when LSD is not available.
 */
Segments detectLineSegments(const cv::Mat& grey, const LineSegmentParams& params, const cv::Rect& region = cv::Rect());

/**
 * How much brighter the image is on the left of a segment than on its right [grey levels]: means over strips of a few
 * pixels' width along it. NaN when one of the strips lies outside the image or the segment has no length.
 * @param grey 8-bit, one channel.
 * @throws std::invalid_argument when the image has the wrong type.
 */
double segmentContrast(const cv::Mat& grey, const Segment& segment);

/** The segments, each directed by its contrast as detectLineSegments() does; one without contrast stays as it is. */
Segments directedByContrast(const cv::Mat& grey, Segments segments);

}  // namespace view_servo
