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
    TO_VIEW,  ///< straight to a pose, turning on the way: for a base that can slide
    STEP,     ///< a length in one direction, without turning (chapter 5 of the thesis)
    TURN,     ///< on the spot, to a yaw
    LINE      ///< along a line to its end, ahead or back: for a base that cannot slide
  };
  Kind kind = STAND;

  // TO_VIEW.
  PlanarPose view;  ///< base pose at the view, in odometry's frame

  // How fast; each names the kinds that use it.
  double gain = 1.0;           ///< TO_VIEW, LINE: speed over the distance that is left, for LINE along the line [1/s]
  double turn_gain = 1.0;      ///< TO_VIEW, TURN: turn rate over the yaw error [1/s]
  double min_speed = 0.0;      ///< TO_VIEW, LINE: least speed, but a LINE stands within its tolerance [m/s]
  double min_turn_rate = 0.0;  ///< TURN: the base turns no slower, however little is left [rad/s]
  double max_speed = std::numeric_limits<double>::infinity();  ///< TO_VIEW, LINE: largest speed [m/s]

  // TURN and LINE.
  PlanarPose end;                   ///< in odometry's frame; a TURN uses only its yaw; the line of a LINE is its x axis
  double distance_tolerance = 0.0;  ///< LINE: the base stands when it is this near to the end, along the line [m]
  double yaw_tolerance = 0.0;       ///< TURN: the base stands when it is this near to the yaw [rad]

  // STEP.
  PlanarPose start;      ///< base pose at the step's beginning, in odometry's frame
  double heading = 0.0;  ///< direction to drive in, in the frame of `start`, 0 = ahead, positive to the left [rad]
  double length = 0.0;   ///< distance to drive [m]
  double speed = 0.0;    ///< speed on the way; the base slows down near the end [m/s]
};

/** The velocity of a base that follows a course, before limits. */
BaseVelocity along(const Course& course, const PlanarPose& base_in_odom);

}  // namespace view_servo
