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
 * Removes the distortion of a camera's images. Images of a camera without distortion stay as they are, with the camera
 * matrix K of its calibration; others are rectified, with the camera matrix in P. Binning and region of interest are
 * taken into account. Not for several threads at once.
 */
class Rectifier
{
public:
  /** @throws std::runtime_error when the camera is not calibrated or its distortion is of an unknown model. */
  explicit Rectifier(const sensor_msgs::CameraInfo& info);

  /** Whether images are changed at all. */
  bool active() const
  {
    return active_;
  }
  /** Camera matrix of rectified images [px]. */
  const Eigen::Matrix3d& k() const
  {
    return k_;
  }
  cv::Size size() const
  {
    return model_.reducedResolution();
  }
  /** Whether a message has the calibration that this was made with; headers are not compared. */
  bool hasCalibration(const sensor_msgs::CameraInfo& info) const;

  /** The rectified image; shares the data of the raw one when not active(). */
  cv::Mat image(const cv::Mat& raw) const;
  Eigen::Vector2d point(const Eigen::Vector2d& raw) const;
  /** The smallest rectangle, within the image, around a raw one after rectification; empty stays empty. */
  cv::Rect region(const cv::Rect& raw) const;

private:
  sensor_msgs::CameraInfo info_;
  image_geometry::PinholeCameraModel model_;
  bool active_;
  Eigen::Matrix3d k_;
};

}  // namespace view_servo
