// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <optional>
#include <vector>

namespace view_servo
{
/** What a matcher says of a view that repeats itself. */
constexpr const char* REPEATED =
    "no geometry found: what matches repeats itself and fits at another place nearly as well; store more of what is "
    "around";

/**
 * What a plane shows may be there more than once: tiles, bricks, windows, a grid. Then a homography that is one period
 * off fits nearly as well as the right one, and which of them is right cannot be told.
 *
 * Where the current image looks alike around two places, the homography is tried that sends to the one what `h` sends
 * to the other; it is fitted to the corners around that are found along it, then to all.
 * @param reference, current 8-bit, one channel.
 * @param matches that agree with `h`, x_cur ~ H x_ref [px].
 * @param current_corners places in the current image where what is there more than once may be found again.
 * @param nearly least part of the matches found there, against the part that is found along `h`.
 * @return another homography along which nearly as large a part of the matches is found again; empty if there is none.
 */
std::optional<Eigen::Matrix3d> otherPlace(const cv::Mat& reference, const cv::Mat& current,
                                          const Correspondences& matches, const std::vector<Corner>& current_corners,
                                          const Eigen::Matrix3d& h, double nearly = 0.85);

}  // namespace view_servo
