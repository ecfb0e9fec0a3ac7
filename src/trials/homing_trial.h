// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/world.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** What makes homing harder. */
struct HomingConditions
{
  double image_noise = -1.0;        ///< sd [grey levels]; negative: the world's
  double odometry_drift = 0.0;      ///< distance measured too long, as a part of it
  double light_gain = 1.0;          ///< against that of the stored view
  double focal_length_error = 0.0;  ///< of the calibration, as a part of it
  double occluded_from = -1.0;      ///< when a person begins to walk by, for 2 s [s]; negative: nobody does
};

struct HomingTrialParams
{
  HomingParams homing;
  VelocityLimits limits;
  HomingConditions conditions;
  bool use_points = true;
  bool use_lines = true;
  bool line_pairs = false;      ///< instead of triplets
  double points_period = 0.5;   ///< between two images that are matched by points [s], > 0
  double lines_period = 1.0;    ///< likewise, by lines
  double matching_time = 0.15;  ///< that passes until matches are there [s]
  double max_duration = 120.0;  ///< [s]
  std::uint64_t seed = 1;
};

/** One cycle of a trial, for plots. */
struct HomingStep
{
  double time = 0.0;
  PlanarPose base;  ///< in the world
  HomingReport report;
  BaseVelocity velocity;
};

struct HomingOutcome
{
  bool arrived = false;         ///< says homing
  std::string reason;           ///< why it ended
  double distance_error = 0.0;  ///< true one, at the end [m]
  double ahead_error = 0.0;     ///< of this, past (+) or before (-) the goal along its x axis [m]
  double side_error = 0.0;      ///< to its left (+) or right (-) [m]
  double yaw_error = 0.0;       ///< true one [rad]
  double duration = 0.0;        ///< [s]
  double travelled = 0.0;       ///< [m]
};

/**
 * Homing in a simulated world, in one process and as fast as it can: image, matching, homing, limits, base, with the
 * same classes that the nodes use and the delays that they have. The view is stored at the world's goal.
 */
class HomingTrials
{
public:
  /** For base worlds. Matches with the default parameters. @throws what SimulatedCamera throws. */
  HomingTrials(const World& world, const HomingTrialParams& params);
  ~HomingTrials();

  /** @param on_step called after each image, may be empty. @throws std::invalid_argument when the start is no place. */
  HomingOutcome run(const PlanarPose& start, const std::function<void(const HomingStep&)>& on_step = {});

private:
  struct Parts;
  World world_;
  HomingTrialParams params_;
  std::unique_ptr<Parts> parts_;
};

/**
 * A random start: `distance` from the goal, in any direction within +-60 degrees behind or in front of it, yaw off by up
 * to 10 degrees, where the base can stand and at least 30 % of the stored view is in sight.
 */
PlanarPose randomStart(const World& world, Rng& rng);

}  // namespace view_servo::sim
