// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo
{
/** Calibration of a pinhole camera, with the meaning of sensor_msgs/CameraInfo (REP 104). */
struct Camera
{
  int width = 0;  ///< of the calibrated image [px]
  int height = 0;
  std::string distortion_model;                 ///< "plumb_bob", "rational_polynomial" or empty: not distorted
  std::vector<double> distortion;               ///< in the order of the model
  Eigen::Matrix3d k = Eigen::Matrix3d::Zero();  ///< intrinsics of the raw image [px]; zero = uncalibrated
  Eigen::Matrix3d rectification = Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 3, 4> projection = Eigen::Matrix<double, 3, 4>::Zero();  ///< of the rectified image [px]

  bool calibrated() const
  {
    return k(0, 0) > 0.0 && k(1, 1) > 0.0;
  }

  /**
   * Pixel of the raw image -> point (x, y) on the plane z = 1 of the optical frame, distortion removed.
   * NaN when the camera is not calibrated and where the distortion has no inverse.
   * @throws std::invalid_argument for other distortion models.
   */
  Eigen::Vector2d normalized(const Eigen::Vector2d& pixel) const;

  /**
   * Point of the optical frame [m], z > 0 -> pixel of the raw image, distortion applied. NaN when the camera is not
   * calibrated and for points that are not in front of it.
   * @throws std::invalid_argument for other distortion models.
   */
  Eigen::Vector2d project(const Eigen::Vector3d& point) const;
};

}  // namespace view_servo
