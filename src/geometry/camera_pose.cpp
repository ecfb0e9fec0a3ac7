// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera_pose.h"

#include "view_servo/geometry/essential.h"

namespace view_servo
{
CameraPose cameraPoseAfter(const Eigen::Isometry3d& motion, const Eigen::Matrix<double, 6, 6>& covariance)
{
  // p = -R^T t, and rotations about the view's axes.
  const Eigen::Matrix3d back = motion.linear().transpose();
  Eigen::Matrix<double, 6, 6> by_motion = Eigen::Matrix<double, 6, 6>::Zero();
  by_motion.topLeftCorner<3, 3>() = -back * crossMatrix(motion.translation());
  by_motion.topRightCorner<3, 3>() = -back;
  by_motion.bottomLeftCorner<3, 3>() = -back;
  CameraPose pose;
  pose.view_from_current.linear() = back;
  pose.view_from_current.translation() = -back * motion.translation();
  pose.covariance = by_motion * covariance * by_motion.transpose();
  return pose;
}

}  // namespace view_servo
