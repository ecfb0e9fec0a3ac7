// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "patch.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/tracking/homography_aligner.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <vector>

namespace view_servo
{
/** @file
 * The corners of a stored view and the squares about them, in all levels of a pyramid: what is looked for in each
 * image.
 */

/** Levels of half the size each, the image itself first. */
std::vector<cv::Mat> pyramidOf(const cv::Mat& image, int levels);

/** From pixels of an image to those of a level of its pyramid. */
Eigen::Matrix3d toLevel(int level);

/** The region, or the whole view when that is empty. @throws std::invalid_argument when something cannot be used. */
cv::Rect checkedRegion(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params);

/** The corners of a region [px], strongest first. @throws std::invalid_argument when they are too few. */
Points findCorners(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params);

/** The patches of all levels, of all points. */
std::vector<std::vector<Patch>> patchesOf(const cv::Mat& reference, const Points& points,
                                          const HomographyAlignerParams& params);

}  // namespace view_servo
