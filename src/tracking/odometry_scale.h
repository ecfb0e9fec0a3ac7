// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace view_servo
{
/** A camera's motion from the stored view, X_cur = R X_view + t with t in a unit of its own, and where it was. */
struct MeasuredWay
{
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< t
  Eigen::Isometry3d camera_in_odom = Eigen::Isometry3d::Identity();
};

/** How long a unit is. */
struct OdometryScale
{
  double metres = 1.0;              ///< that a unit is long
  double relative_deviation = 0.0;  ///< standard deviation of 1 / metres, as a part of it
};

/**
 * The length of the unit, by how much t changes when odometry says that the camera has moved by dt [m]: t2 - dR t1 = dt
 * / metres, in least squares over all pairs of ways, for 1 / metres. Solved for metres it would come out too small,
 * because the left side is noisier than odometry's dt. The deviation is what the residuals let one expect.
 * @return empty when no two cameras are `apart` [m], or the changes contradict odometry.
 */
std::optional<OdometryScale> scaleByOdometry(const std::vector<MeasuredWay>& ways, double apart);

}  // namespace view_servo
