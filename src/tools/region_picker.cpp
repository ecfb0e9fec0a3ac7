// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/region_picker.h"

#include <algorithm>

namespace view_servo
{
void RegionPicker::setImageSize(const cv::Size& size)
{
  if (size != size_)
  {
    size_ = size;
    dragged_ = false;
    first_.reset();
  }
}

double RegionPicker::scale() const
{
  return size_.empty() ? 1.0
                       : std::min({ 1.0, static_cast<double>(MAX_WIDTH) / size_.width,
                                    static_cast<double>(MAX_HEIGHT) / size_.height });
}

cv::Point RegionPicker::toImage(const cv::Point& place) const
{
  // A corner of a region lies between pixels, so that it may be one beyond the last.
  return { std::clamp(cvRound(place.x / scale()), 0, size_.width),
           std::clamp(cvRound(place.y / scale()), 0, size_.height) };
}

void RegionPicker::press(const cv::Point& place)
{
  dragged_ = true;
  first_ = second_ = toImage(place);
}

void RegionPicker::move(const cv::Point& place)
{
  if (dragged_)
  {
    second_ = toImage(place);
  }
}

void RegionPicker::release(const cv::Point& place)
{
  move(place);
  dragged_ = false;
  const cv::Rect picked = region();
  if (std::min(picked.width, picked.height) < MIN_SIDE)
  {
    first_.reset();
  }
}

cv::Rect RegionPicker::region() const
{
  return first_ ? cv::Rect(*first_, second_) : cv::Rect();
}

}  // namespace view_servo
