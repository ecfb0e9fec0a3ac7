// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <limits>
#include <string>

namespace view_servo
{
/**
 * Draws a match, BGR: the reference on the left, the current image on the right, and below a line of text that says
 * what was found, or why nothing was.
 *  - Points: inliers are joined by lines, coloured by their position in the reference; other candidates are small dots.
 *  - Line segments: the two of a pair have one colour, and the best sixty show their rank. Segments on the first plane
 *    are plain, those on the second carry a bead, on the third two; those on no plane are thin. Intersections are small
 *    dots.
 *  - For the homography of a plane, the outline of the reference's region is drawn in both images.
 */
cv::Mat drawOverlay(const PreparedImage& reference, const PreparedImage& current, const ViewMatch& match);

/** A stored view that is tracked, for drawFollowedView(). */
struct FollowedView
{
  cv::Rect region;  ///< region of the stored view that is tracked [px]
  /** x_cur ~ H x_ref [px]; NaN: the view was not found, and neither its outline nor its points are drawn. */
  Eigen::Matrix3d h = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  Points found;  ///< points of the stored view that were found, at their places there [px]; drawn where h sends them
  /** Points of the stored view that were not found, at their places there [px]; drawn where h sends them. */
  Points missing;
  Points path;       ///< where the view's chosen point has been, in current pixels, newest last
  std::string text;  ///< one line, drawn below
};

/**
 * Draws a tracked view, BGR: the outline of its region, points found in green, missing ones in red, the path, the text.
 * @param current 8-bit, one channel.
 */
cv::Mat drawFollowedView(const cv::Mat& current, const FollowedView& view);

}  // namespace view_servo
