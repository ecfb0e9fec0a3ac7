// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CompressedImage.h>
#include <std_msgs/Header.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace test
{
/** A picture as a camera's driver sends it. @param extension ".jpg" or ".png". */
inline sensor_msgs::CompressedImage compressed(const cv::Mat& picture, const std::string& extension,
                                               const std::string& format, const std_msgs::Header& header = {})
{
  sensor_msgs::CompressedImage message;
  message.header = header;
  message.format = format;
  if (!cv::imencode(extension, picture, message.data))
  {
    throw std::runtime_error("cannot encode " + extension);
  }
  return message;
}

/** A PNG of few bytes whose header says that it has this size. */
inline sensor_msgs::CompressedImage pngOfSize(std::uint32_t width, std::uint32_t height)
{
  sensor_msgs::CompressedImage message = compressed(cv::Mat::zeros(32, 32, CV_8U), ".png", "mono8; png compressed ");
  constexpr int PLACE = 16;  // of the width, big-endian, before the height
  for (int i = 0; i < 4; ++i)
  {
    message.data[PLACE + i] = static_cast<std::uint8_t>(width >> (24 - 8 * i));
    message.data[PLACE + 4 + i] = static_cast<std::uint8_t>(height >> (24 - 8 * i));
  }
  return message;
}

/** A JPEG of few bytes whose header says that it has this size. */
inline sensor_msgs::CompressedImage jpegOfSize(std::uint16_t width, std::uint16_t height)
{
  sensor_msgs::CompressedImage message = compressed(cv::Mat::zeros(32, 32, CV_8U), ".jpg", "jpeg");
  for (std::size_t i = 0; i + 8 < message.data.size(); ++i)
  {
    if (message.data[i] == 0xFF && message.data[i + 1] == 0xC0)  // start of frame: length, bits a sample, height, width
    {
      message.data[i + 5] = static_cast<std::uint8_t>(height >> 8);
      message.data[i + 6] = static_cast<std::uint8_t>(height);
      message.data[i + 7] = static_cast<std::uint8_t>(width >> 8);
      message.data[i + 8] = static_cast<std::uint8_t>(width);
      return message;
    }
  }
  throw std::runtime_error("a JPEG without a start of frame");
}

}  // namespace test
}  // namespace view_servo
