// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

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
 * 16 bits of which the picture uses less than 0.4 of the range are stretched between the levels of nearly all pixels.
 * @param name what an error calls the image.
 * @throws ImageError for other types, empty images and sizes beyond the two limits.
 */
cv::Mat toGrey(const cv::Mat& image, const std::string& name);

/**
 * The size that the header of a PNG, JPEG, PNM, BMP or TIFF file gives, without decoding the image; of a TIFF with
 * strips or tiles larger than the image that of these, as decoding takes the memory for them.
 * @throws ImageError when the bytes do not begin as such a file, or the size is beyond the limits.
 */
cv::Size encodedImageSize(const std::string& bytes, const std::string& name);

/**
 * The image in the bytes of such a file as it is: 8 or 16 bits, 1, 3 (BGR) or 4 (BGRA) channels, not turned.
 * @throws ImageError as encodedImageSize() does, and when the data is damaged.
 */
cv::Mat decodeImage(const std::string& bytes, const std::string& name);

/**
 * The bytes of a PNG, JPEG, PNM, BMP or TIFF file as 8-bit grey. Other formats are refused, as they cannot tell their
 * size before they are decoded. @param name what an error calls the image.
 * @throws ImageError when it is not such an image, is damaged, or has a size beyond the limits.
 */
cv::Mat decodeGreyImage(const std::string& bytes, const std::string& name);

/**
 * An image file as 8-bit grey. @throws ImageError as decodeGreyImage(), and when the file is missing, not a regular
 * file or not readable.
 */
cv::Mat readGreyImage(const std::string& path);

/**
 * Why a grey image, 8 bits, can hardly show anything: "nearly black", "nearly white", "nearly the same everywhere"; or
 * "".
 */
std::string lackOfLight(const cv::Mat& grey);

}  // namespace view_servo
