// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/numbers.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
namespace
{
}

double PlanarPose::distance() const
{
  return std::hypot(x, y);
}

double PlanarPose::heading() const
{
  return std::atan2(y, x);
}

double wrapAngle(double angle)
{
  const double wrapped = std::remainder(angle, 2.0 * M_PI);
  return wrapped <= -M_PI ? M_PI : wrapped;
}

PlanarPose compose(const PlanarPose& b_in_a, const PlanarPose& c_in_b)
{
  const double c = std::cos(b_in_a.yaw);
  const double s = std::sin(b_in_a.yaw);
  return { b_in_a.x + c * c_in_b.x - s * c_in_b.y, b_in_a.y + s * c_in_b.x + c * c_in_b.y,
           wrapAngle(b_in_a.yaw + c_in_b.yaw) };
}

PlanarPose inverse(const PlanarPose& b_in_a)
{
  const double c = std::cos(b_in_a.yaw);
  const double s = std::sin(b_in_a.yaw);
  return { -c * b_in_a.x - s * b_in_a.y, s * b_in_a.x - c * b_in_a.y, wrapAngle(-b_in_a.yaw) };
}

PlanarPose toPlanar(const Eigen::Isometry3d& pose)
{
  const Eigen::Vector3d ahead = pose.linear().col(0);
  return { pose.translation().x(), pose.translation().y(), std::atan2(ahead.y(), ahead.x()) };
}

CameraMount::CameraMount(const Eigen::Isometry3d& base_from_camera)
{
  constexpr double MAX_TILT = M_PI / 3.0;
  const Eigen::Vector3d axis = base_from_camera.linear().col(2);
  if (!(std::abs(std::asin(std::clamp(axis.z(), -1.0, 1.0))) <= MAX_TILT))
  {
    throw std::invalid_argument("the camera's optical axis is more than 60 degrees out of the horizontal");
  }
  on_base = { base_from_camera.translation().x(), base_from_camera.translation().y(), std::atan2(axis.y(), axis.x()) };
  Eigen::Matrix3d base_from_level;
  base_from_level.col(2) = Eigen::Vector3d(std::cos(on_base.yaw), std::sin(on_base.yaw), 0.0);
  base_from_level.col(1) = -Eigen::Vector3d::UnitZ();
  base_from_level.col(0) = base_from_level.col(1).cross(base_from_level.col(2));
  level_from_camera = base_from_level.transpose() * base_from_camera.linear();
}

Eigen::Vector2d CameraMount::level(const Eigen::Vector2d& point) const
{
  const Eigen::Vector3d ray = level_from_camera * point.homogeneous();
  return ray.z() > 0.0 ? Eigen::Vector2d(ray.hnormalized()) : Eigen::Vector2d::Constant(NOT_A_NUMBER);
}

Eigen::Vector2d CameraMount::unlevel(const Eigen::Vector2d& point) const
{
  const Eigen::Vector3d ray = level_from_camera.transpose() * point.homogeneous();
  return ray.z() > 0.0 ? Eigen::Vector2d(ray.hnormalized()) : Eigen::Vector2d::Constant(NOT_A_NUMBER);
}

PlanarPose CameraMount::ofBase(const PlanarPose& camera_in_camera) const
{
  return compose(compose(on_base, camera_in_camera), inverse(on_base));
}

PlanarPose CameraMount::ofCamera(const PlanarPose& base_in_base) const
{
  return compose(compose(inverse(on_base), base_in_base), on_base);
}

}  // namespace view_servo
