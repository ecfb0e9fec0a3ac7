// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"

#include <deque>
#include <string>

namespace view_servo
{
/**
 * Compares what a base is told with what its odometry says that it does. Knows no ROS; times are by one clock [s]. When
 * it goes back, or on by more than 0.5 s between two calls, as a clock that is set does, the comparison begins anew.
 */
class MotionWatch
{
public:
  /** A command has been sent, to be followed until the next one. */
  void addCommand(double time, const BaseVelocity& velocity);

  /**
   * Takes the pose of the base in odometry's frame at a time [s].
   * @return one sentence when odometry has disagreed with the commands for 2 s: that the base does not move, moves in
   * another direction or in the opposite one. Empty while they agree, and while zero is commanded.
   */
  std::string addOdometry(double time, const PlanarPose& base_in_odom);

  /** Forgets what it knows. */
  void clear()
  {
    moments_.clear();
    command_ = BaseVelocity::Zero();
  }

private:
  static constexpr double WINDOW = 2.0;  // [s]

  struct Moment
  {
    double time;            // [s]
    PlanarPose in_odom;     // pose of the base by odometry
    PlanarPose by_command;  // pose of the base by the commands alone, from an arbitrary start
  };

  /** Moves by_command_ on to a time, by the last command. */
  void advance(double time);

  BaseVelocity command_ = BaseVelocity::Zero();
  double time_ = 0.0;           // the time that by_command_ is of [s]
  PlanarPose by_command_;       // where the base would be at time_ by the commands alone
  std::deque<Moment> moments_;  // oldest first; since when the base has been told to move without a break
};

}  // namespace view_servo
