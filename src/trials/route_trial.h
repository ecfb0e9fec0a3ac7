// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"
#include "trials/homing_trial.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/route_guide.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/tracking/route_spacing.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** Options of runRoute(). */
struct RouteTrialParams
{
  HomingParams homing;
  RouteGuideParams guide;
  RouteSpacingParams spacing;
  VelocityLimits limits;
  /**
   * What makes it harder, of which only the noise of images, the errors of odometry and the light are used: the light
   * while the route is followed, the others while it is recorded, too.
   */
  HomingConditions conditions;
  double matching_period = 0.2;  ///< between two images that are matched by points [s], > 0
  double matching_time = 0.15;   ///< from an image's stamp until homing gets its matches [s]
  double max_duration = 300.0;   ///< after which a run is given up [s]
  std::uint64_t seed = 1;        ///< of the noise of images and odometry
};

/** How a route was followed. */
struct RouteOutcome
{
  bool arrived = false;     ///< whether homing says that it has arrived at the last view
  std::string reason;       ///< why the run ended
  std::size_t views = 0;    ///< number of views of the route
  std::size_t reached = 0;  ///< number of the view that was driven to last, from 1
  double length = 0.0;      ///< true length of the recorded way [m]
  /** RMS, over the way driven, of the base's true distances from the recorded way, once a view was passed [m]; or NaN. */
  double sideways_rms = std::numeric_limits<double>::quiet_NaN();
  double sideways_max = std::numeric_limits<double>::quiet_NaN();  ///< largest of these distances [m]
  double distance_error = 0.0;  ///< true distance from the last view's place at the end [m]
  double yaw_error = 0.0;       ///< true yaw less that at the last view, at the end [rad]
  double duration = 0.0;        ///< time of following the route [s]
};

/**
 * Records a route in a simulated world, driving straight from one waypoint to the next, and follows it, in one process
 * and with the classes and delays of the nodes.
 * @param waypoints poses of the base in the world, at least two. @param start where it is put to follow the route.
 * @throws std::invalid_argument naming faults of the parameters, or what stands in the way.
 */
RouteOutcome runRoute(const World& world, const RouteTrialParams& params, const std::vector<PlanarPose>& waypoints,
                      const PlanarPose& start);

}  // namespace view_servo::sim
