// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/video.h"

#include "view_servo/images/image_io.h"

#include <opencv2/videoio.hpp>

#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace view_servo
{
Video::Video(const std::string& path) : path_(path), capture_(std::make_unique<cv::VideoCapture>())
{
  // Else OpenCV takes the name for a camera's address, or for a pattern of names of images.
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
  {
    throw std::runtime_error("'" + path + "' is not there, or no regular file");
  }
  bool opened = false;
  try
  {
    opened = capture_->open(path);
  }
  catch (const cv::Exception&)
  {
    // It is no video for this backend.
  }
  if (!opened)
  {
    throw std::runtime_error("'" + path + "' is no video that this OpenCV can read");
  }
  const double pixels = capture_->get(cv::CAP_PROP_FRAME_WIDTH) * capture_->get(cv::CAP_PROP_FRAME_HEIGHT);
  if (pixels > static_cast<double>(MAX_IMAGE_PIXELS))
  {
    throw std::runtime_error("'" + path + "' has images of more than " + std::to_string(MAX_IMAGE_PIXELS) + " pixels");
  }
}

Video::~Video() = default;

double Video::rate() const
{
  constexpr double HIGHEST = 1e4;  // of high-speed cameras; what is beyond is no rate
  const double rate = capture_->get(cv::CAP_PROP_FPS);
  return std::isfinite(rate) && rate > 0.0 && rate <= HIGHEST ? rate : 0.0;
}

cv::Mat Video::next()
{
  cv::Mat frame;
  try
  {
    if (!capture_->read(frame))
    {
      return {};
    }
  }
  catch (const cv::Exception&)
  {
    return {};  // it is damaged from here on
  }
  return toGrey(frame, path_);
}

}  // namespace view_servo
