// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/rectifier.h"

#include "view_servo/ros/conversions.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace view_servo
{
Rectifier::Rectifier(const sensor_msgs::CameraInfo& info) : info_(info)
{
  if (!isCalibrated(info))
  {
    throw std::runtime_error("the camera is not calibrated: K is all zero, or a number is not finite");
  }
  model_.fromCameraInfo(info);
  active_ = std::any_of(info.D.begin(), info.D.end(), [](double coefficient) { return coefficient != 0.0; });
  const Camera camera = toCamera(info);
  k_ = active_ ? Eigen::Matrix3d(camera.projection.leftCols<3>()) : camera.k;
  if (active_)
  {
    try
    {
      point({ 0.0, 0.0 });
    }
    catch (const image_geometry::Exception& error)
    {
      throw std::runtime_error("the camera's distortion '" + info.distortion_model +
                               "' cannot be removed: " + error.what());
    }
  }
}

bool Rectifier::hasCalibration(const sensor_msgs::CameraInfo& info) const
{
  return sameCalibration(info_, info);
}

cv::Mat Rectifier::image(const cv::Mat& raw) const
{
  cv::Mat rectified = raw;
  if (active_)
  {
    rectified = cv::Mat();
    model_.rectifyImage(raw, rectified);
  }
  return rectified;
}

Eigen::Vector2d Rectifier::point(const Eigen::Vector2d& raw) const
{
  if (!active_)
  {
    return raw;
  }
  const cv::Point2d rectified = model_.rectifyPoint(cv::Point2d(raw.x(), raw.y()));
  return { rectified.x, rectified.y };
}

cv::Rect Rectifier::region(const cv::Rect& raw) const
{
  constexpr int PARTS = 16;  // of each side: rectified sides are curved
  if (!active_ || raw.empty())
  {
    return raw;
  }
  Eigen::Vector2d least = Eigen::Vector2d::Constant(INFINITY);
  Eigen::Vector2d greatest = -least;
  for (int i = 0; i <= PARTS; ++i)
  {
    const double u = raw.x + (raw.width - 1.0) * i / PARTS;
    const double v = raw.y + (raw.height - 1.0) * i / PARTS;
    for (const Eigen::Vector2d& corner : { Eigen::Vector2d(u, raw.y), Eigen::Vector2d(u, raw.y + raw.height - 1.0),
                                           Eigen::Vector2d(raw.x, v), Eigen::Vector2d(raw.x + raw.width - 1.0, v) })
    {
      const Eigen::Vector2d at = point(corner);
      least = least.cwiseMin(at);
      greatest = greatest.cwiseMax(at);
    }
  }
  const auto within = [](double value, int limit) {  // a distortion without sense sends points anywhere
    return value > 0.0 ? std::min(value, static_cast<double>(limit)) : 0.0;
  };
  const int width = size().width;
  const int height = size().height;
  const cv::Point from(static_cast<int>(std::ceil(within(least.x(), width))),
                       static_cast<int>(std::ceil(within(least.y(), height))));
  const cv::Point to(static_cast<int>(std::floor(within(greatest.x(), width))) + 1,
                     static_cast<int>(std::floor(within(greatest.y(), height))) + 1);
  return cv::Rect(from, to) & cv::Rect(0, 0, width, height);
}

}  // namespace view_servo
