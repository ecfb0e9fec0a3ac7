// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/visibility.h"

#include "view_servo/geometry/region.h"

#include <cmath>

namespace view_servo::sim
{
std::optional<double> firstHit(const World& world, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               double nearest)
{
  std::optional<double> first;
  for (const Surface& surface : world.surfaces)
  {
    if (!surface.group.empty())
    {
      continue;
    }
    // In the surface's frame it is the plane z = 0.
    const Eigen::Vector3d from = surface.pose.inverse() * origin;
    const Eigen::Vector3d along = surface.pose.linear().transpose() * direction;
    const double distance = -from.z() / along.z();
    if (!(distance > nearest) || (first && distance >= *first))
    {
      continue;
    }
    const Eigen::Vector3d point = from + distance * along;
    if (std::abs(point.x()) <= 0.5 * surface.size.x() && std::abs(point.y()) <= 0.5 * surface.size.y())
    {
      first = distance;
    }
  }
  return first;
}

double shareInSight(const World& world, const Eigen::Isometry3d& reference, const Eigen::Isometry3d& current)
{
  constexpr int STEP = 24;            // of the pixels tried
  constexpr double CLEARANCE = 1e-3;  // a point does not hide itself [m]
  int seen = 0;
  int seen_again = 0;
  for (int v = STEP / 2; v < world.camera.height; v += STEP)
  {
    for (int u = STEP / 2; u < world.camera.width; u += STEP)
    {
      const Eigen::Vector3d ray = world.camera.normalized({ u, v }).homogeneous().normalized();
      const Eigen::Vector3d direction = reference.linear() * ray;
      const std::optional<double> distance = firstHit(world, reference.translation(), direction);
      if (!distance)
      {
        continue;
      }
      ++seen;
      const Eigen::Vector3d point = reference.translation() + *distance * direction;
      const Eigen::Vector2d pixel = world.camera.project(current.inverse() * point);
      if (!(pixel.x() >= 0.0 && pixel.x() < world.camera.width && pixel.y() >= 0.0 && pixel.y() < world.camera.height))
      {
        continue;
      }
      const Eigen::Vector3d back = (current.translation() - point).normalized();
      const std::optional<double> hidden = firstHit(world, point, back, CLEARANCE);
      seen_again += !hidden || *hidden > (current.translation() - point).norm() ? 1 : 0;
    }
  }
  return seen > 0 ? static_cast<double>(seen_again) / seen : 0.0;
}

cv::Rect regionSeenFrom(const World& world, const Eigen::Isometry3d& camera)
{
  const cv::Rect image(0, 0, world.camera.width, world.camera.height);
  if (world.region.empty())
  {
    return image;
  }
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : cornersOf(world.region))
  {
    const Eigen::Vector3d direction = world.goal.linear() * world.camera.normalized(corner).homogeneous().normalized();
    const std::optional<double> distance = firstHit(world, world.goal.translation(), direction);
    const Eigen::Vector3d point = world.goal.translation() + distance.value_or(0.0) * direction;
    const Eigen::Vector3d there = camera.inverse() * point;
    if (!distance || !(there.z() > 0.0))
    {
      return {};
    }
    box.extend(world.camera.project(there));
  }
  const auto pixel = [](const Eigen::Vector2d& point) {
    return cv::Point(static_cast<int>(std::lround(point.x())), static_cast<int>(std::lround(point.y())));
  };
  return cv::Rect(pixel(box.min()), pixel(box.max()) + cv::Point(1, 1)) & image;
}

}  // namespace view_servo::sim
