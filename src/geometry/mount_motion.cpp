// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mount_motion.h"

#include "hand_eye_motion.h"

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace mount
{
MountMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses, const Eigen::Vector3d& normal)
{
  const HandEyeMotion motion =
      normal.allFinite() ? hand_eye::motionOf(problem, poses, normal) : hand_eye::motionOf(problem, poses);
  MountMotion result;
  result.poses = motion.poses;
  result.travel = motion.travel;
  constexpr double ALIKE = 0.17;  // turned [rad]
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    for (std::size_t k = i + 1; k < poses.size(); ++k)
    {
      const PlanarPose way = compose(inverse(toPlanar(poses[i].flange_in_base)), toPlanar(poses[k].flange_in_base));
      result.turn = std::max(result.turn, std::abs(way.yaw));
      if (std::abs(way.yaw) <= ALIKE)
      {
        result.way = std::max(result.way, way.distance());
      }
    }
  }
  return result;
}

std::string offTheFloor(const std::vector<HandEyePose>& poses)
{
  constexpr double TILT = 0.05;   // [rad]
  constexpr double CLIMB = 0.03;  // [m]
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    const Eigen::Isometry3d& base = poses[i].flange_in_base;
    const double tilt = std::acos(std::clamp(base.linear()(2, 2), -1.0, 1.0));
    const double climb = std::abs(base.translation().z() - poses.front().flange_in_base.translation().z());
    if (tilt > TILT || climb > CLIMB)
    {
      return "odometry has the base not on a level floor: at pose " + std::to_string(i + 1) + " it is tilted by " +
             hand_eye::rounded(DEGREES * tilt) + " degrees, and " + hand_eye::rounded(1e3 * climb, 0) +
             " mm higher or lower than at first; check that the frames are right";
    }
  }
  return "";
}

}  // namespace mount

MountMotion mountMotion(const HandEyeView& view, const std::vector<HandEyePose>& poses)
{
  hand_eye::check(view, poses);
  return mount::motionOf(mount::Problem(view, poses, hand_eye::NONE), poses, Eigen::Vector3d::Constant(hand_eye::NONE));
}

std::vector<std::string> missingMotion(const MountMotion& motion, const MountParams& params)
{
  using hand_eye::rounded;
  std::vector<std::string> lines;
  const int least = std::max(params.min_poses, hand_eye::LEAST_POSES);
  if (motion.poses < least)
  {
    lines.push_back("there are " + std::to_string(motion.poses) + " different poses: " + std::to_string(least) +
                    " are needed, 1 cm or 2 degrees from one another");
  }
  if (motion.turn < params.min_turn)
  {
    lines.push_back("the base was turned by " + rounded(motion.turn * DEGREES) +
                    " degrees at most: turn it on the spot, by " + rounded(params.min_turn * DEGREES, 0) +
                    " degrees or more from the left to the right");
  }
  if (motion.way < params.min_way)
  {
    lines.push_back("the base has driven straight on for " + rounded(1e3 * motion.way, 0) +
                    " mm at most: drive straight ahead or back by " + rounded(1e3 * params.min_way, 0) +
                    " mm or more, without a turn");
  }
  if (!(motion.travel >= params.min_travel))
  {
    lines.push_back(hand_eye::lackOfTravel(motion.travel, params.min_travel));
  }
  return lines;
}

}  // namespace view_servo
