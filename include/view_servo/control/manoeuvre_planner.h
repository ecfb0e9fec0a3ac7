// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"

#include <functional>
#include <vector>

namespace view_servo
{
/** @file
 * Ways home for a base that cannot slide: it turns on the spot and drives straight, ahead or back, so that the camera
 * keeps the stored view in sight. All poses are of the base, in the frame of the goal: the base's where the view was
 * stored.
 */

/** A straight part of a manoeuvre. Before it the base turns on the spot. */
struct Leg
{
  PlanarPose end;          ///< where the leg ends; on the whole leg the base has this yaw
  bool backwards = false;  ///< the base drives backwards
};

/** Turns and legs in turn; after the last leg, which ends at the goal, the base turns to yaw 0. */
struct Manoeuvre
{
  std::vector<Leg> legs;
  double least_share = 1.0;     ///< least share of the view in sight on the way, [0, 1]
  double blind_distance = 0.0;  ///< length of the way with too little of the view in sight [m]
  double blind_turn = 0.0;      ///< angle of the turns with too little of the view in sight [rad]
  double length = 0.0;          ///< of all legs [m]
  double duration = 0.0;        ///< estimated time, for a base that drives 0.25 m/s and turns 0.4 rad/s [s]
};

/** Options of manoeuvres. */
struct ManoeuvreParams
{
  double min_share = 0.4;           ///< share of the view that is kept in sight where some way allows it, [0, 1]
  double blind_share = 0.15;        ///< the base counts as blind where a smaller share of the view is in sight, [0, 1]
  double max_blind_distance = 0.3;  ///< longest way that the base may drive blindly [m]
  double max_blind_turn = 0.5;      ///< largest angle that it may turn blindly [rad]
  double max_retreat =
      1.0;  ///< how far the base may back up behind both its start and the goal, where it sees nothing [m]
  double straight_end = 0.3;  ///< least length of the last leg, which lies along the goal's x axis [m]
};

/** Names, units and ranges of these parameters. */
std::vector<Parameter> parameters(ManoeuvreParams& params);

/** The share of the view, [0, 1], that the camera has in sight when the base is at a pose. */
using ShareInSight = std::function<double(const PlanarPose& base_in_goal)>;

/**
 * The best compromise between time and length among the manoeuvres that keep params.min_share of the view in sight and
 * do not retreat too far. Where none does, the best one of these and the share whose blind part is within its bounds.
 * It ends after some thousand calls of `share`, with the best one found by then.
 * @return a manoeuvre without legs when there is none.
 */
Manoeuvre planManoeuvre(const PlanarPose& base_in_goal, const ShareInSight& share, const ManoeuvreParams& params);

}  // namespace view_servo
