// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include <optional>

namespace view_servo
{
/**
 * A region of an image that somebody drags with the mouse in a window, where the image may be shown smaller than it is.
 * Not for several threads.
 */
class RegionPicker
{
public:
  /** Images larger than this are shown smaller [px]. */
  static constexpr int MAX_WIDTH = 1280;
  static constexpr int MAX_HEIGHT = 800;

  /** A drag over a region with a shorter side counts as a click, which removes the region [px of the image]. */
  static constexpr int MIN_SIDE = 16;

  /** Says how large the image is [px]. When that changes, the region is gone. */
  void setImageSize(const cv::Size& size);

  /** Size of the image as it is shown over its true size, (0, 1]. */
  double scale() const;

  /** The mouse's button, at a pixel of the window. Places beside the image are moved to its border. */
  void press(const cv::Point& place);
  void move(const cv::Point& place);
  void release(const cv::Point& place);

  /** The region, also while it is dragged [px of the image], within the image; empty: none, everywhere. */
  cv::Rect region() const;

  /** Whether the button is down. */
  bool isDragged() const
  {
    return dragged_;
  }

private:
  cv::Point toImage(const cv::Point& place) const;

  cv::Size size_;
  bool dragged_ = false;
  std::optional<cv::Point> first_;  // corner of the region, in the image
  cv::Point second_;                // the opposite one
};

}  // namespace view_servo
