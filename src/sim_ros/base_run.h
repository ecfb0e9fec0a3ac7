// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"
#include "sim_ros/robot_messages.h"
#include "view_servo/geometry/planar_pose.h"

#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <string>

namespace view_servo
{
/** @file What the programs that run a simulated base once share. */

/**
 * The start that a text means: "x y yaw" [m, m, rad] in the world, where yaw may be left out, or the name of one of the
 * world's starts. @throws std::invalid_argument when it is neither.
 */
inline Eigen::Isometry3d parseStart(const sim::World& world, const std::string& text)
{
  std::istringstream stream(text);
  double x = 0.0;
  double y = 0.0;
  double yaw = 0.0;
  if (!(stream >> x >> y))
  {
    return world.start(text);
  }
  if (!(stream >> yaw) && !stream.eof())
  {
    throw std::invalid_argument("start: '" + text + "' is neither \"x y yaw\" nor a start's name");
  }
  return sim::planarPose(x, y, yaw);
}

/**
 * The pose on the floor of a camera, whose x axis is the camera's optical axis seen from above. @param camera world
 * from camera.
 */
inline PlanarPose onFloor(const Eigen::Isometry3d& camera)
{
  const Eigen::Vector3d axis = camera.linear().col(2);
  return { camera.translation().x(), camera.translation().y(), std::atan2(axis.y(), axis.x()) };
}

/** How far the base ends from where the view was stored. @param goal, end world from the camera. */
inline std::string describeEnd(const Eigen::Isometry3d& goal, const Eigen::Isometry3d& end, double travelled,
                               double duration)
{
  const PlanarPose off = compose(inverse(onFloor(goal)), onFloor(end));
  char text[200];
  std::snprintf(text, sizeof(text),
                "the base is %.1f mm and %.2f degrees from where the view was stored (%.1f mm ahead, %.1f mm to the "
                "left), after %.2f m in %.1f s",
                1e3 * off.distance(), off.yaw * 180.0 / M_PI, 1e3 * off.x, 1e3 * off.y, travelled, duration);
  return text;
}

}  // namespace view_servo
