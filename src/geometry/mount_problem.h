// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hand_eye_problem.h"
#include "view_servo/geometry/mount_calibration.h"
#include "view_servo/geometry/planar_pose.h"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace view_servo
{
/** What the parts of calibrateMount() share. */
namespace mount
{
using hand_eye::Indices;
using hand_eye::Problem;

/**
 * Unknowns besides the base's poses: camera on base without its height (5), view in odometry's frame (6), plane (3).
 */
constexpr int SHARED = 14;
constexpr int PER_POSE = 3;  // unknowns of a base's pose: its place (2) and yaw along its own axes

/** The unknowns of a calibration. The base, and the camera on it, have the height 0. */
struct Estimate
{
  hand_eye::State state;          ///< of which the flange is the base, and the arm's base the frame of odometry
  std::vector<PlanarPose> bases;  ///< where the base was at each pose, in the frame of odometry
};

/** How far odometry has moved from one pose to a later one. */
struct Leg
{
  std::size_t from;
  std::size_t to;
  PlanarPose motion;  ///< of the base at `to` in the base at `from`, by odometry
  double way_sigma;   ///< standard deviation of its place, along each axis, by MountParams [m]
  double turn_sigma;  ///< standard deviation of its yaw, by MountParams [rad]
  bool on_the_spot;   ///< less of `way_sigma` comes of its length than of its turn
};

/** The legs between poses that follow one another among the `used`, which ascend. */
std::vector<Leg> legsBetween(const Indices& used, const std::vector<PlanarPose>& odometry, const MountParams& params);

/**
 * How far two poses of the base are from what a leg says: place, then yaw, in standard deviations. The place is taken
 * in the frame half way through the turn: so an error of the turn that grows evenly on the way does not shift it.
 * @param by_from,by_to derivatives by the poses along their own axes, 3 x 3; may be null.
 */
Eigen::Vector3d legError(const Leg& leg, const PlanarPose& from, const PlanarPose& to,
                         Eigen::MatrixXd* by_from = nullptr, Eigen::MatrixXd* by_to = nullptr);

/** A planar pose as one in space, at the height 0. */
Eigen::Isometry3d inSpace(const PlanarPose& pose);

/** Where the base was, by an image. @param motion of the camera from the view to there, over the plane's distance. */
PlanarPose baseByImage(const hand_eye::State& state, const EuclideanHomography& motion);

}  // namespace mount
}  // namespace view_servo
