// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera_pose.h"
#include "view_servo/geometry/rotation_vector.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

namespace view_servo::test
{
/** Mean squared error of a pose in units of its standard deviations: 1 when the covariance is honest, in the mean. */
inline double normalisedError(const CameraPose& pose, const Eigen::Isometry3d& view_from_current)
{
  Eigen::Matrix<double, 6, 1> error;
  error << pose.view_from_current.translation() - view_from_current.translation(),
      rotationVector(pose.view_from_current.linear() * view_from_current.linear().transpose());
  return error.dot(pose.covariance.llt().solve(error)) / 6.0;
}

}  // namespace view_servo::test
