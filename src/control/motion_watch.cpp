// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/motion_watch.h"

#include <cmath>
#include <sstream>

namespace view_servo
{
namespace
{
std::string inWords(const PlanarPose& motion)
{
  std::ostringstream text;
  text.precision(2);
  text << std::fixed << motion.x << " m ahead, " << motion.y << " m to the left and " << motion.yaw << " rad of turn";
  return text.str();
}

}  // namespace

void MotionWatch::advance(double time)
{
  constexpr double LONGEST = 0.5;  // between two calls [s]
  // A clock that was set, or calls that ceased: nothing is known of the motion meanwhile.
  if (!(std::abs(time - time_) <= LONGEST))
  {
    moments_.clear();
    time_ = time;
    return;
  }
  const BaseVelocity step = (time - time_) * command_;
  by_command_ = compose(by_command_, { step.x(), step.y(), step.z() });
  time_ = time;
}

void MotionWatch::addCommand(double time, const BaseVelocity& velocity)
{
  advance(time);
  command_ = velocity;
  if (velocity.isZero(0.0))
  {
    moments_.clear();
  }
}

std::string MotionWatch::addOdometry(double time, const PlanarPose& base_in_odom)
{
  constexpr double LEAST_WAY = 0.06;   // of a command that is judged [m]
  constexpr double LEAST_TURN = 0.15;  // [rad]
  constexpr double SHARE = 0.5;        // of the motion: a larger difference is a disagreement
  if (command_.isZero(0.0))
  {
    return "";
  }
  advance(time);
  moments_.push_back({ time, base_in_odom, by_command_ });
  if (time - moments_.front().time < WINDOW)
  {
    return "";
  }
  const PlanarPose wanted = compose(inverse(moments_.front().by_command), by_command_);
  const PlanarPose done = compose(inverse(moments_.front().in_odom), base_in_odom);
  while (moments_.size() > 1 && time - moments_[1].time >= WINDOW)
  {
    moments_.pop_front();
  }
  const double across = std::hypot(wanted.x - done.x, wanted.y - done.y);
  const double turn = std::abs(wrapAngle(wanted.yaw - done.yaw));
  const bool other_way = wanted.distance() >= LEAST_WAY && across > SHARE * wanted.distance();
  const bool other_turn = std::abs(wanted.yaw) >= LEAST_TURN && turn > SHARE * std::abs(wanted.yaw);
  if (!other_way && !other_turn)
  {
    return "";
  }
  // What makes the commonest of all such set-ups.
  const bool slides =
      std::abs(wanted.y - done.y) > SHARE * across && std::abs(done.y) < (1.0 - SHARE) * std::abs(wanted.y);
  const std::string advice = slides ? "; one that cannot slide needs ~base: differential" : "";
  return "the base does not do what it is told: in the last 2 s that was " + inWords(wanted) +
         ", and by odometry it did " + inWords(done) + advice;
}

}  // namespace view_servo
