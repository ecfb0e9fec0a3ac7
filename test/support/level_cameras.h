// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace test
{
/** @file Poses of cameras above a floor, made by nothing that is tested. */

constexpr double CAMERA_HEIGHT = 1.1;  // [m]

/** Frame of base_link's kind (x ahead, y left, z up) from the optical frame of a level camera. */
inline Eigen::Matrix3d ahead()
{
  Eigen::Matrix3d optical;
  optical << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  return optical;
}

inline Eigen::Isometry3d onFloor(const PlanarPose& pose, double height = 0.0)
{
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  result.translation() << pose.x, pose.y, height;
  return result;
}

/** World from the optical frame of a level camera, by nothing that is tested. */
inline Eigen::Isometry3d levelCamera(const PlanarPose& pose)
{
  Eigen::Isometry3d camera = onFloor(pose, CAMERA_HEIGHT);
  camera.linear() = camera.linear() * ahead();
  return camera;
}

/** Depth of a point in front of a camera [m]; negative: behind it. */
inline double depthOf(const Eigen::Isometry3d& camera, const Eigen::Vector3d& point)
{
  return (camera.inverse() * point).z();
}

inline Eigen::Vector2d seenBy(const Eigen::Isometry3d& camera, const Eigen::Vector3d& point)
{
  const Eigen::Vector3d x = camera.inverse() * point;
  return x.hnormalized();
}

/** Largest difference of two poses, metres and radians alike. */
inline double difference(const PlanarPose& a, const PlanarPose& b)
{
  return std::max({ std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(wrapAngle(a.yaw - b.yaw)) });
}

}  // namespace test
}  // namespace view_servo
