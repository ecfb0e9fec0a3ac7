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
    default:
      return BaseVelocity::Zero();
  }
}

}  // namespace view_servo
