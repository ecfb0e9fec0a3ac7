// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <optional>

namespace view_servo
{
/**
 * Where else in a picture is what a region of it shows: tiles, bricks, windows or shelves are there more than once, and
 * which of them a stored view means cannot be told from another picture, as matchers then say.
 * @param grey 8-bit, one channel. @param region of the picture [px]; empty: everywhere.
 * @return from the region's middle to the other place [px]; empty: there is none, or too few corners tell.
 * @throws std::invalid_argument for another type of picture.
 */
std::optional<Eigen::Vector2d> otherPlaceInPicture(const cv::Mat& grey, const cv::Rect& region);

}  // namespace view_servo
