// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <opencv2/core/types.hpp>

namespace view_servo
{
namespace test
{
/** K of a pinhole camera. @param fx,fy focal lengths [px]. @param cx,cy where the optical axis meets the image [px]. */
inline Eigen::Matrix3d cameraMatrix(double fx, double fy, double cx, double cy)
{
  Eigen::Matrix3d k;
  k << fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0;
  return k;
}

/** A calibrated camera without distortion and without rectification. */
inline Camera pinholeCamera(const cv::Size& size, double fx, double fy, double cx, double cy)
{
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.k = cameraMatrix(fx, fy, cx, cy);
  return camera;
}

/** The matrix of a cross product: crossMatrix(a) b = a x b. */
inline Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v)
{
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/**
 * The fundamental matrix of two views, x_current^T F x_reference = 0, as Longuet-Higgins has it: made by nothing that
 * is tested.
 * @param r,t the motion X_current = R X_reference + t.
 */
inline Eigen::Matrix3d fundamentalOf(const Eigen::Matrix3d& k_reference, const Eigen::Matrix3d& k_current,
                                     const Eigen::Matrix3d& r, const Eigen::Vector3d& t)
{
  return k_current.inverse().transpose() * crossMatrix(t) * r * k_reference.inverse();
}

}  // namespace test
}  // namespace view_servo
