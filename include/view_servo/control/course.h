// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"

#include <limits>

namespace view_servo
{
/**
 * Where a base has to go: what estimation hands to control, as a value. A course stays valid until the next image or
 * matches give another one, while odometry goes on. Poses are in odometry's frame.
 */
struct Course
{
  enum Kind
  {
    STAND,    ///< nothing is known of where to go
    TO_VIEW,  ///< straight to a pose, turning on the way
    STEP      ///< a length in one direction, without turning (chapter 5 of the thesis)
  };
  Kind kind = STAND;

  // TO_VIEW.
  PlanarPose view;         ///< base pose at the view, in odometry's frame
  double gain = 1.0;       ///< the base's speed divided by its distance from the view [1/s]
  double turn_gain = 1.0;  ///< the base's turn rate divided by its yaw error [1/s]
  double min_speed = 0.0;  ///< the base is no slower, however near the view is [m/s]
  double max_speed = std::numeric_limits<double>::infinity();  ///< the base is no faster, however far the view is [m/s]

  // STEP.
  PlanarPose start;      ///< base pose at its beginning, in odometry's frame
  double heading = 0.0;  ///< direction to drive in, in the frame of `start`, 0 = ahead, positive to the left [rad]
  double length = 0.0;   ///< distance to drive [m]
  double speed = 0.0;    ///< speed on the way; the base slows down near the end [m/s]
};

/** The velocity of a base that follows a course, before limits. */
BaseVelocity along(const Course& course, const PlanarPose& base_in_odom);

}  // namespace view_servo
