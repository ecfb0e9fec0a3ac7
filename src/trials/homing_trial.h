// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/world.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** What makes homing harder. The defaults add nothing. */
struct HomingConditions
{
  double image_noise = -1.0;         ///< standard deviation [grey levels]; negative: the world's
  double odometry_drift = 0.0;       ///< part by which distances are measured too long
  double light_gain = 1.0;           ///< factor of the light under which the view was stored
  double focal_length_error = 0.0;   ///< part by which the calibration's focal lengths are too long
  double occluded_from = -1.0;       ///< when a person begins to walk by, which takes 2 s [s]; negative: never
  double odometry_turn_scale = 1.0;  ///< measured turn over true turn
  double deadband_speed = 0.0;       ///< slower commands do not move the base [m/s]
  double deadband_turn_rate = 0.0;   ///< slower commands do not turn it [rad/s]
  double odometry_delay = 0.0;       ///< how much later odometry is stamped than images of the same moment [s]
  double slip_share = 0.0;           ///< share of the time in which the wheels slip
  double slip_loss = 0.5;            ///< part of their motion that is lost then
};

/** Options of HomingTrials. */
struct HomingTrialParams
{
  HomingParams homing;
  VelocityLimits limits;
  HomingConditions conditions;
  ViewStructure structure;      ///< what is known of the view beforehand; without points: nothing
  bool use_points = true;       ///< whether images are matched by points
  bool use_lines = true;        ///< whether images are matched by lines
  bool line_pairs = false;      ///< groups of lines are pairs instead of triplets
  double points_period = 0.5;   ///< between two images that are matched by points [s], > 0
  double lines_period = 1.0;    ///< between two images that are matched by lines [s], > 0
  double matching_time = 0.15;  ///< from an image's stamp until homing gets its matches [s]
  double max_duration = 120.0;  ///< after which a run is given up [s]
  std::uint64_t seed = 1;       ///< of the noise of images and odometry
};

/** The state when homing gets an image. */
struct HomingStep
{
  double time = 0.0;      ///< since the start [s]
  PlanarPose base;        ///< true pose of the base in the world when the image was taken [m, rad]
  HomingReport report;    ///< with what homing makes of the image
  BaseVelocity velocity;  ///< true velocity of the base, in its own frame [m/s, rad/s]
};

/** How a run ended. */
struct HomingOutcome
{
  bool arrived = false;         ///< whether homing says that it has arrived
  std::string reason;           ///< why homing ended
  double distance_error = 0.0;  ///< true distance from the goal at the end [m]
  double ahead_error = 0.0;     ///< part of the distance along the goal's x axis: past (+) or before (-) the goal [m]
  double side_error = 0.0;      ///< part of the distance across that axis: to the goal's left (+) or right (-) [m]
  double yaw_error = 0.0;       ///< true yaw less the goal's, at the end [rad]
  double duration = 0.0;        ///< until homing ended [s]
  double travelled = 0.0;       ///< length of the true path [m]
  int reversals = 0;            ///< how often the base changed between driving ahead and back
  int stops = 0;                ///< how often homing had the base stand that was under way, before it ended
  double in_sight = 0.0;        ///< share of the images in which the view was found, once it had been found
  ViewStructure structure;      ///< what homing has learnt of the view
};

/**
 * Runs of homing in a simulated world, in one process and as fast as it can: images, matching, homing, velocity limits
 * and the base, with the same classes that the nodes use and with the delays that the nodes have. The view is stored at
 * the world's goal.
 */
class HomingTrials
{
public:
  /** @param world of the base. Matchers have their default parameters. @throws what SimulatedCamera throws. */
  HomingTrials(const World& world, const HomingTrialParams& params);
  ~HomingTrials();

  /**
   * @param start of the base, in the world.
   * @param on_step is called for each image, after homing got it; may be empty.
   * @throws std::invalid_argument naming faults of the parameters, or what stands at the start.
   */
  HomingOutcome run(const PlanarPose& start, const std::function<void(const HomingStep&)>& on_step = {});

private:
  struct Parts;
  class Run;

  World world_;
  HomingTrialParams params_;
  std::unique_ptr<Parts> parts_;
};

/**
 * A random start in the world: 0.4 to 2 m behind or in front of the goal, in a direction within 60 degrees of the
 * goal's axis, with the yaw off by up to `max_yaw` [rad], where the base can stand and at least 30 % of the stored view
 * is in sight.
 */
PlanarPose randomStart(const World& world, Rng& rng, double max_yaw = M_PI / 18.0);

}  // namespace view_servo::sim
