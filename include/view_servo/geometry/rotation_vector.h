// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace view_servo
{
/** The rotation about the direction of `vector` by an angle of its length [rad]. */
inline Eigen::Matrix3d rotationFromVector(const Eigen::Vector3d& vector)
{
  const double angle = vector.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix()
                     : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

/** A rotation's axis times its angle, which is in [0, pi] [rad]; the inverse of rotationFromVector(). */
inline Eigen::Vector3d rotationVector(const Eigen::Matrix3d& rotation)
{
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

}  // namespace view_servo
