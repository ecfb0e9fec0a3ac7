// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo
{
/**
 * Calibration of a camera, with the meaning of sensor_msgs/CameraInfo (REP 104). Models of the lens:
 *  - "plumb_bob" (0, 4 or 5 coefficients) and "rational_polynomial" (0, 5, 8, 12 or 14), as OpenCV has them: without
 *    coefficients, or with zeros alone, the camera is a pinhole;
 *  - "equidistant" (4 coefficients; none stands for zeros), the fisheye model of Kannala and Brandt (2006), equation 6:
 *    r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9) at the angle t to the axis. It is no pinhole with zeros either;
 *  - empty or "none", with zeros alone: a pinhole.
 */
struct Camera
{
  int width = 0;                                ///< width of the images that the calibration is of [px]
  int height = 0;                               ///< their height [px]
  std::string distortion_model;                 ///< one of the models above
  std::vector<double> distortion;               ///< coefficients, in the order of the model
  Eigen::Matrix3d k = Eigen::Matrix3d::Zero();  ///< intrinsics of the raw image [px]; zero = uncalibrated
  Eigen::Matrix3d rectification = Eigen::Matrix3d::Identity();  ///< raw frame -> rectified frame; zero = identity
  /** Projection matrix of the rectified image [px]; all zeros: the rectified image has the intrinsics `k`. */
  Eigen::Matrix<double, 3, 4> projection = Eigen::Matrix<double, 3, 4>::Zero();

  bool calibrated() const
  {
    return k(0, 0) > 0.0 && k(1, 1) > 0.0;
  }

  /**
   * Why the camera cannot be used, naming the field of sensor_msgs/CameraInfo, in one line: it is not calibrated, a
   * number is not finite, the coefficients do not fit the model, or the model is unknown. Empty when it can be used.
   */
  std::string fault() const;

  /** Whether raw images are those of a pinhole, with the camera matrix `k`. For a camera that has no fault(). */
  bool isPinhole() const;

  /** The pinhole that rectified images are of; the camera itself when it is one. For a camera that has no fault(). */
  Camera rectified() const;

  /** The rotation raw frame -> rectified frame. */
  Eigen::Matrix3d rectifyingRotation() const
  {
    return rectification.isZero(0.0) ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : rectification;
  }

  /**
   * Pixel of the raw image -> point (x, y) on the plane z = 1 of the optical frame, distortion removed. NaN when the
   * camera is not calibrated, where the distortion has no inverse, and for rays that do not meet that plane.
   * @throws std::invalid_argument for a distortion that fault() names.
   */
  Eigen::Vector2d normalized(const Eigen::Vector2d& pixel) const;
  Points normalized(const Points& pixels) const;

  /**
   * Point (x, y) on the plane z = 1 of the optical frame -> pixel of the raw image, distortion applied. NaN when the
   * camera is not calibrated, and for rays so far out that the distortion folds back.
   * @throws std::invalid_argument for a distortion that fault() names.
   */
  Points distorted(const Points& points) const;

  /**
   * Point of the optical frame [m], z > 0 -> pixel of the raw image, distortion applied. NaN when the camera is not
   * calibrated, for points that are not in front of it, and as distorted().
   * @throws std::invalid_argument for a distortion that fault() names.
   */
  Eigen::Vector2d project(const Eigen::Vector3d& point) const;
};

}  // namespace view_servo
