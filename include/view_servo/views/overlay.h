// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <string>

namespace view_servo
{
/**
 * A picture of a match, BGR: reference left, current right, inliers joined by lines coloured by their place in the
 * reference, other candidates as small dots. A match of line segments shows them instead, a pair in one colour, up to
 * sixty with their rank, and their intersections as small dots: those of the first plane are plain, those of the second
 * carry a bead, of the third two, and those of no plane are thin. For the homography of one plane the outline of the
 * reference's region is drawn in both images. A line of text below says what was found (or why nothing was).
 */
cv::Mat drawOverlay(const PreparedImage& reference, const PreparedImage& current, const ViewMatch& match);

/** A stored view that is followed through images. */
struct FollowedView
{
  cv::Rect region;    ///< of the stored view [px]
  Eigen::Matrix3d h;  ///< x_cur ~ H x_ref; NaN: not found
  Points found;       ///< points of the stored view that were found [px]
  Points missing;     ///< those that were not [px]
  Points path;        ///< where its chosen point has been, in current pixels, newest last
  std::string text;   ///< one line
};

/** A picture of it, BGR: the outline of the region, found points green, missing ones red, the path, the text below. */
cv::Mat drawFollowedView(const cv::Mat& current, const FollowedView& view);

}  // namespace view_servo
