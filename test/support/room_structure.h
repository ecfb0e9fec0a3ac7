// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/room_corner.h"
#include "view_servo/views/view_store.h"
#include "view_servo/views/view_structure.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>

namespace view_servo
{
namespace test
{
/** The pose of an optical frame that looks along x of a frame whose z axis is up. */
inline ViewPose levelPose()
{
  ViewPose pose;
  pose.frame = "base_link";
  Eigen::Matrix3d base_from_camera;
  base_from_camera << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  pose.orientation = base_from_camera;
  return pose;
}

/** RoomCorner's reference as a view, by a camera that is not tilted. */
inline StoredView roomView(const RoomCorner& room)
{
  StoredView view;
  view.name = "room";
  view.image = room.reference;
  view.camera = roomCamera();
  view.frame_id = "camera";
  view.pose = levelPose();
  return view;
}

/** The true depths of a grid of points, `step` apart [px]. */
inline ViewStructure roomStructure(int step)
{
  constexpr double INFORMATION = 0.01;  // of a point that was seen from 0.1 m aside [m^2]
  ViewStructure structure;
  for (int v = step; v < PICTURE_SIZE.height; v += step)
  {
    for (int u = step; u < PICTURE_SIZE.width; u += step)
    {
      const Eigen::Vector2d at = roomCamera().normalized(Eigen::Vector2d(u, v));
      // The walls at 45 degrees to the axis meet 4 m ahead: z + |x| = 4 m.
      structure.points.push_back({ Eigen::Vector2d(u, v), (1.0 + std::abs(at.x())) / 4.0, INFORMATION });
    }
  }
  return structure;
}

/** Where RoomCorner's current camera is: points of its frame -> of the reference's frame [m]. */
inline Eigen::Isometry3d roomViewFromCurrent()
{
  Eigen::Isometry3d current_from_view(Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitY()));
  current_from_view.translation() = Eigen::Vector3d(-0.6, 0.1, 0.2);
  return current_from_view.inverse();
}

}  // namespace test
}  // namespace view_servo
