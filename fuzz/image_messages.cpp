// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"
#include "message.h"

#include "view_servo/images/image_io.h"
#include "view_servo/ros/camera_image.h"
#include "view_servo/ros/conversions.h"

#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <boost/make_shared.hpp>
#include <opencv2/core/utils/logger.hpp>

#include <optional>

using namespace view_servo;

namespace
{
constexpr std::uint64_t LARGEST = 1'000'000;  // to decode more takes so long that little else would be tried [px]

void requireNoLarger(const cv::Mat& image, std::uint64_t width, std::uint64_t height)
{
  fuzz::require(static_cast<std::uint64_t>(image.cols) <= width && static_cast<std::uint64_t>(image.rows) <= height,
                "an image is no larger than its message says");
}

void requireGrey(const cv::Mat& grey, std::uint64_t width, std::uint64_t height)
{
  fuzz::require(grey.type() == CV_8UC1, "an image is grey");
  requireNoLarger(grey, width, height);
}

void requireColour(const cv::Mat& colour, std::uint64_t width, std::uint64_t height)
{
  fuzz::require(colour.type() == CV_8UC3, "an image for people has colours");
  requireNoLarger(colour, width, height);
}

void readRaw(const sensor_msgs::Image& message)
{
  if (std::uint64_t{ message.width } * message.height > LARGEST && message.data.size() > LARGEST)
  {
    return;
  }
  const CameraImage image(boost::make_shared<sensor_msgs::Image>(message), "/image_raw");
  fuzz::readOrRefuse<ImageError>([&] { requireGrey(toGrey(image), message.width, message.height); });
  fuzz::readOrRefuse<ImageError>([&] { requireColour(toColour(image), message.width, message.height); });
}

void readCompressed(const sensor_msgs::CompressedImage& message)
{
  const CameraImage image(boost::make_shared<sensor_msgs::CompressedImage>(message), "/image_raw/compressed");
  if (!image.fault.empty())
  {
    fuzz::requireReason(image.fault);
    return;
  }
  const std::uint64_t pixels = std::uint64_t{ image.width } * image.height;
  fuzz::require(pixels <= MAX_IMAGE_PIXELS, "sizes beyond the limits are refused before decoding");
  if (pixels <= LARGEST)
  {
    fuzz::readOrRefuse<ImageError>([&] { requireGrey(toGrey(image), image.width, image.height); });
    fuzz::readOrRefuse<ImageError>([&] { requireColour(toColour(image), image.width, image.height); });
  }
}
}  // namespace

/** A camera's image as it comes over the network: raw when the first byte is even, compressed when it is odd. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  if (size == 0)
  {
    return 0;
  }
  if (data[0] % 2 == 0)
  {
    if (const std::optional<sensor_msgs::Image> message = fuzz::received<sensor_msgs::Image>(data + 1, size - 1))
    {
      readRaw(*message);
    }
  }
  else if (const auto message = fuzz::received<sensor_msgs::CompressedImage>(data + 1, size - 1))
  {
    readCompressed(*message);
  }
  return 0;
}
