// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_geometry/pinhole_camera_model.h>
#include <sensor_msgs/CameraInfo.h>
#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace view_servo
{
/**
 * Images without distortion: those of a camera that has none are left as they are, with K of its calibration; others are
 * rectified, with P's K. Binning and region of interest are worked in. Not for several threads at once.
 */
class Rectifier
{
public:
  /** @throws std::runtime_error when the camera is not calibrated or its distortion is of an unknown model. */
  explicit Rectifier(const sensor_msgs::CameraInfo& info);

  /** Whether it changes anything. */
  bool active() const
  {
    return active_;
  }
  /** Camera matrix of the images it gives [px]. */
  const Eigen::Matrix3d& k() const
  {
    return k_;
  }
  cv::Size size() const
  {
    return model_.reducedResolution();
  }
  /** Whether another calibration says the same, whatever its header. */
  bool isOf(const sensor_msgs::CameraInfo& info) const;

  /** Shares the data of the raw image when it changes nothing. */
  cv::Mat image(const cv::Mat& raw) const;
  Eigen::Vector2d point(const Eigen::Vector2d& raw) const;
  /** The smallest rectangle around where a raw one goes, within the image; empty stays empty. */
  cv::Rect region(const cv::Rect& raw) const;

private:
  sensor_msgs::CameraInfo info_;
  image_geometry::PinholeCameraModel model_;
  bool active_;
  Eigen::Matrix3d k_;
};

}  // namespace view_servo
