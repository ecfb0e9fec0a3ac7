// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace view_servo
{
/**
 * How alike the strips beside a segment and its counterpart are: samples of the reference image, 1 to 8.5 px from the
 * segment, are compared with the current image at the places where a homography sends them, along the part of the
 * segment that both images show. Each side has its own zero-mean normalised correlation, and the larger one is
 * returned, since one side may be background that moves differently.
 * @param reference, current 8-bit, one channel, usually smoothed. @param h x_cur ~ H x_ref [px].
 * @return in [-1, 1]; nearly 0 where the intensities are flat, 0 when the segment maps to or beyond infinity, and -1
 * when on neither side enough samples lie within both images.
 */
double sideCorrelation(const cv::Mat& reference, const cv::Mat& current, const Eigen::Matrix3d& h,
                       const Segment& reference_segment, const Segment& current_segment);

}  // namespace view_servo
