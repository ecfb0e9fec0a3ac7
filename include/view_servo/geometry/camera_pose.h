// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace view_servo
{
/** Where a camera is, seen from where it, or another one, was at a stored view. */
struct CameraPose
{
  /** Points of the current camera's optical frame -> of the optical frame of the view's camera [m]. */
  Eigen::Isometry3d view_from_current = Eigen::Isometry3d::Identity();
  /** Of x, y, z [m] and of rotations about the view's x, y, z axes [rad], as in geometry_msgs/PoseWithCovariance. */
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/**
 * The pose after a motion that is known as exactly as a covariance says.
 * @param motion X_cur = R X_view + t [m]. @param covariance of a small rotation vector w [rad], R' = exp(w) R, and of
 * t [m].
 */
CameraPose cameraPoseAfter(const Eigen::Isometry3d& motion, const Eigen::Matrix<double, 6, 6>& covariance);

}  // namespace view_servo
