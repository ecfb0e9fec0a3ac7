// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace view_servo
{
/** An image that cannot be used; what() names the file or topic and says why, in one line. */
class ImageError : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/** Larger images are refused: nothing here gains from them, and a robot's memory is small [px]. */
constexpr std::int64_t MAX_IMAGE_PIXELS = 50'000'000;

/** Images with fewer pixels on a side hold nothing to match [px]. */
constexpr int MIN_IMAGE_SIDE = 16;

/**
 * Any 8- or 16-bit image with 1, 3 (BGR) or 4 (BGRA) channels as 8-bit grey; shares the data when it is that already.
 * @param name what an error calls the image.
 * @throws ImageError for other types, empty images and sizes beyond the two limits.
 */
cv::Mat toGrey(const cv::Mat& image, const std::string& name);

/**
 * Reads an image file as 8-bit grey.
 * @throws ImageError when it is missing, not readable, not an image or of a size beyond the limits (told from the
 * file's header before it is decoded, for PNG, JPEG and PNM).
 */
cv::Mat readGreyImage(const std::string& path);

}  // namespace view_servo
