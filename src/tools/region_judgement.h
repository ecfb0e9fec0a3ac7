// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <string>

namespace view_servo
{
/** What a region of a picture offers to matching. */
struct RegionJudgement
{
  std::string text;     ///< one line, with what to do when it is not good
  bool is_good = true;  ///< nothing speaks against it
};

/**
 * Judges a region by the measures of check_robot: corners, segments, light, sharpness.
 * @param picture 8-bit, grey or BGR. @param region [px]; what is beyond the picture does not count; empty: all of it.
 */
RegionJudgement judgeRegion(const cv::Mat& picture, const cv::Rect& region);

}  // namespace view_servo
