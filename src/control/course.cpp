// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/course.h"

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace
{
BaseVelocity towards(double speed, double heading, double turn_rate)
{
  return { speed * std::cos(heading), speed * std::sin(heading), turn_rate };
}

/** Proportional to what is left, but no slower than `least`, and never faster than `most`; zero within the tolerance. */
double approach(double left, double gain, double least, double most, double tolerance)
{
  return std::abs(left) <= tolerance
             ? 0.0
             : std::copysign(std::clamp(gain * std::abs(left), std::min(least, most), most), left);
}

/**
 * Drives along the end's x axis and back onto it. The distance across is made up for within some CONVERGENCE of way,
 * without overshoot: with s the length of way driven, y'' + DAMPING / C y' + y / C² = 0.
 */
BaseVelocity alongLine(const Course& course, const PlanarPose& base_in_odom)
{
  constexpr double CONVERGENCE = 0.1;   // [m]
  constexpr double DAMPING = 2.5;       // 2 would be critical
  constexpr double MOST_ACROSS = 0.03;  // from farther away, the base comes back at the same angle [m]
  constexpr double FASTEST = 1e3;       // std::clamp() wants a finite limit [m/s]
  const PlanarPose base = compose(inverse(course.end), base_in_odom);
  const double speed =
      approach(-base.x, course.gain, course.min_speed, std::min(course.max_speed, FASTEST), course.distance_tolerance);
  const double across = std::clamp(base.y, -MOST_ACROSS, MOST_ACROSS) / CONVERGENCE;
  const double turn_rate = -(DAMPING * std::abs(speed) * base.yaw + speed * across) / CONVERGENCE;
  return { speed, 0.0, turn_rate };
}

}  // namespace

BaseVelocity along(const Course& course, const PlanarPose& base_in_odom)
{
  switch (course.kind)
  {
    case Course::TO_VIEW:
    {
      const PlanarPose goal = compose(inverse(base_in_odom), course.view);
      const double speed = std::clamp(course.gain * goal.distance(), course.min_speed, course.max_speed);
      return towards(speed, goal.heading(), course.turn_gain * goal.yaw);
    }
    case Course::STEP:
    {
      // The step's direction is that of the pose where it began; slower towards its end.
      constexpr double SLOWING = 4.0;      // [1/s]
      constexpr double LAST_SPEED = 0.01;  // [m/s]
      const PlanarPose done = compose(inverse(course.start), base_in_odom);
      const double left = course.length - done.distance();
      return left > 0.0 ? towards(std::min(course.speed, SLOWING * left + LAST_SPEED), course.heading - done.yaw, 0.0)
                        : BaseVelocity(BaseVelocity::Zero());
    }
    case Course::TURN:
    {
      constexpr double FASTEST = 1e3;  // [rad/s]
      const double left = wrapAngle(course.end.yaw - base_in_odom.yaw);
      return { 0.0, 0.0, approach(left, course.turn_gain, course.min_turn_rate, FASTEST, course.yaw_tolerance) };
    }
    case Course::LINE:
      return alongLine(course, base_in_odom);
    default:
      return BaseVelocity::Zero();
  }
}

}  // namespace view_servo
