// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/numbers.h"

#include "trials/route_trial.h"

#include "sim/world_reader.h"
#include "test_paths.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
World desk()
{
  return findWorld("desk", PACKAGE_DIR "/config/worlds");
}

TEST(RouteTrial, FollowsARouteWithBendsBesideWhichItBegins)
{
  RouteTrialParams params;
  params.conditions.odometry_drift = 0.05;
  params.conditions.odometry_turn_scale = 1.05;
  params.conditions.light_gain = 0.7;
  const std::vector<PlanarPose> waypoints = { { -1.6, 0.2, 0.0 }, { -0.8, -0.1, 5.0 * DEGREE }, { 0.3, 0.1, 0.0 } };
  const RouteOutcome outcome = runRoute(desk(), params, waypoints, { -1.65, 0.3, -3.0 * DEGREE });
  EXPECT_TRUE(outcome.arrived) << outcome.reason << " at view " << outcome.reached << " of " << outcome.views;
  EXPECT_GE(outcome.views, 5U);
  EXPECT_LT(outcome.distance_error, 0.01);
  EXPECT_LT(std::abs(outcome.yaw_error), 1.0 * DEGREE);
  EXPECT_LT(outcome.sideways_rms, 0.1);
  EXPECT_LT(outcome.sideways_max, 0.25);
}

TEST(RouteTrial, FollowsARouteOnWhichTheBaseTurns)
{
  RouteTrialParams params;
  const std::vector<PlanarPose> waypoints = { { -1.2, 0.0, -12.0 * DEGREE }, { -0.4, 0.0, 12.0 * DEGREE } };
  const RouteOutcome outcome = runRoute(desk(), params, waypoints, { -1.25, 0.05, -10.0 * DEGREE });
  EXPECT_TRUE(outcome.arrived) << outcome.reason << " at view " << outcome.reached << " of " << outcome.views;
  EXPECT_LT(outcome.distance_error, 0.01);
}

TEST(RouteTrial, LeadsABaseThatCannotSlide)
{
  RouteTrialParams params;
  params.homing.approach.base = BaseKind::DIFFERENTIAL;
  const std::vector<PlanarPose> waypoints = { { -1.6, 0.0, 0.0 }, { 0.3, 0.0, 0.0 } };
  const RouteOutcome outcome = runRoute(desk(), params, waypoints, { -1.7, 0.05, 2.0 * DEGREE });
  EXPECT_TRUE(outcome.arrived) << outcome.reason << " at view " << outcome.reached << " of " << outcome.views;
  EXPECT_LT(outcome.distance_error, 0.01);
  EXPECT_LT(outcome.sideways_max, 0.25);
}

TEST(RouteTrial, SaysWhereItLosesItsWay)
{
  RouteTrialParams params;
  const std::vector<PlanarPose> waypoints = { { -1.6, 0.0, 0.0 }, { -0.6, 0.0, 0.0 } };
  const RouteOutcome outcome = runRoute(desk(), params, waypoints, { -1.6, 0.0, 170.0 * DEGREE });
  EXPECT_FALSE(outcome.arrived);
  EXPECT_EQ(outcome.reason, "the view was not found");
  EXPECT_EQ(outcome.reached, 1U);
  EXPECT_TRUE(std::isnan(outcome.sideways_rms)) << "no view was passed";
}

TEST(RouteTrial, RefusesARouteOfOnePlace)
{
  EXPECT_THROW(runRoute(desk(), RouteTrialParams(), { { 0.0, 0.0, 0.0 } }, {}), std::invalid_argument);
}

}  // namespace
}  // namespace view_servo::sim
