// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include <cstdint>
#include <limits>

namespace view_servo
{
namespace test
{
/** A picture whose pixels have nothing to do with each other: any value that the type, of 8 or 16 bits, can hold. */
inline cv::Mat randomPicture(std::uint64_t seed, const cv::Size& size, int type = CV_8UC1)
{
  cv::Mat picture(size, type);
  cv::RNG(seed).fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_16U ? 65536 : 256);
  return picture;
}

/** Largest difference of grey levels; infinite where size or type differ. */
inline double largestDifference(const cv::Mat& a, const cv::Mat& b)
{
  return a.size() == b.size() && a.type() == b.type() ? cv::norm(a, b, cv::NORM_INF)
                                                      : std::numeric_limits<double>::infinity();
}

}  // namespace test
}  // namespace view_servo
