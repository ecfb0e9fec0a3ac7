// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include <memory>
#include <string>

namespace cv
{
class VideoCapture;
}

namespace view_servo
{
/** The frames of a video file, one after the other. */
class Video
{
public:
  /**
   * @throws std::runtime_error naming the file when it is no video that OpenCV can read, or has images beyond the limits
   * of image_io.h.
   */
  explicit Video(const std::string& path);
  ~Video();
  Video(const Video&) = delete;
  Video& operator=(const Video&) = delete;

  /** Frames a second, by the file; 0 when it does not say. */
  double rate() const;

  /** The next frame, 8-bit grey; empty after the last one that can be read. @throws ImageError as toGrey() does. */
  cv::Mat next();

private:
  std::string path_;
  std::unique_ptr<cv::VideoCapture> capture_;
};

}  // namespace view_servo
