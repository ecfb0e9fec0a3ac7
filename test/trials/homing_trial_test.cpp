// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/homing_trial.h"
#include "sim/world_reader.h"

#include "sim/visibility.h"
#include "support/shipped_files.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo::sim
{
namespace
{
World worldOf(const std::string& name)
{
  return readWorld(test::worldFile(name));
}

/** The same with one ray for each pixel, which halves a trial's time: for what does not hang on the last millimetre. */
World coarseWorldOf(const std::string& name)
{
  World world = worldOf(name);
  world.quality.supersampling = 1;
  return world;
}

/** A pose seen from the world's goal. */
PlanarPose fromGoal(const World& world, const PlanarPose& pose)
{
  return compose(toPlanar(world.goal), pose);
}

void expectArrival(const HomingOutcome& outcome, double distance, double angle)
{
  EXPECT_TRUE(outcome.arrived) << outcome.reason;
  EXPECT_LT(outcome.distance_error, distance)
      << outcome.ahead_error << " ahead, " << outcome.side_error << " to the left";
  EXPECT_LT(std::abs(outcome.yaw_error), angle);
  EXPECT_NEAR(std::hypot(outcome.ahead_error, outcome.side_error), outcome.distance_error, 1e-9);
}

}  // namespace

// ---- all that this package knows

TEST(HomingTrial, ArrivesInTheDesksWorld)
{
  const World world = worldOf("desk");
  Rng rng(1);
  const PlanarPose start = randomStart(world, rng);
  HomingTrials trials(world, HomingTrialParams());
  std::vector<HomingStep> steps;
  const HomingOutcome outcome = trials.run(start, [&steps](const HomingStep& step) { steps.push_back(step); });
  expectArrival(outcome, 0.02, 1.0 * DEGREE);
  const double way = compose(inverse(toPlanar(world.goal)), start).distance();
  EXPECT_GE(outcome.travelled, way - 0.02);
  EXPECT_LT(outcome.travelled, 1.5 * way);
  EXPECT_LT(outcome.duration, 30.0);
  EXPECT_EQ(outcome.stops, 0);
  // What was told on the way.
  ASSERT_GT(steps.size(), 10U);
  EXPECT_LT(std::hypot(steps.front().base.x - start.x, steps.front().base.y - start.y), 1e-6);
  EXPECT_EQ(steps.front().report.state, HomingState::ACQUIRING);
  for (std::size_t i = 1; i < steps.size(); ++i)
  {
    EXPECT_GT(steps[i].time, steps[i - 1].time);
    EXPECT_LE(steps[i].velocity.head<2>().norm(), VelocityLimits().max_speed + 1e-9);
  }
}

TEST(HomingTrial, ArrivesInTheCorridorUnderAllHardConditions)
{
  const World world = worldOf("corridor");
  Rng rng(2);
  HomingTrialParams params;
  params.conditions = HomingConditions{ 5.0, 0.05, 0.7, 0.02, 3.0 };
  HomingTrials trials(world, params);
  expectArrival(trials.run(randomStart(world, rng)), 0.02, 1.0 * DEGREE);
}

TEST(HomingTrial, TellsNoDistanceInMetresBeforeItKnowsIt)
{
  // From here the first matches say little about depths: the distance in their unit is wrong by a half at first.
  const World world = worldOf("corridor");
  HomingTrialParams params;
  params.seed = 3;
  params.max_duration = 10.0;  // enough for it to be known, also without lines
  HomingTrials trials(world, params);
  int told = 0;
  trials.run({ 0.8882, 0.8769, -0.0797 }, [&](const HomingStep& step) {
    if (step.report.goal_in_odom)
    {
      ++told;
      const PlanarPose truth = compose(inverse(step.base), toPlanar(world.goal));
      EXPECT_NEAR(step.report.distance, truth.distance(), 0.02 + 0.1 * truth.distance())
          << "after " << step.time << " s";
      EXPECT_LT(std::abs(step.report.distance - truth.distance()),
                6.0 * std::sqrt(step.report.goal_covariance.topLeftCorner<2, 2>().trace()));
    }
  });
  EXPECT_GT(told, 20);
}

TEST(HomingTrial, StandsStillWhenNothingOfTheViewIsInSight)
{
  const World world = worldOf("desk");
  HomingTrialParams params;
  params.homing.lost_timeout = 1.5;
  HomingTrials trials(world, params);
  const HomingOutcome outcome = trials.run(fromGoal(world, { 0.0, 0.0, M_PI }));
  EXPECT_FALSE(outcome.arrived);
  EXPECT_EQ(outcome.reason, "the view was not found");
  EXPECT_EQ(outcome.travelled, 0.0);
  EXPECT_GT(outcome.duration, 1.4);
  EXPECT_LT(outcome.duration, 2.5);
}

TEST(HomingTrial, StandsBetweenMatchesThatComeSeldomWhileNothingIsTracked)
{
  const World world = coarseWorldOf("desk");
  HomingTrialParams params;
  params.homing.tracker.min_supporting = params.homing.tracker.max_landmarks = 100000;
  params.use_lines = false;
  params.points_period = 2.5;
  params.max_duration = 12.0;
  HomingTrials trials(world, params);
  const HomingOutcome outcome = trials.run(fromGoal(world, { -0.9, 0.35, 0.1 }));
  EXPECT_FALSE(outcome.arrived);
  EXPECT_GT(outcome.travelled, 0.05);
  EXPECT_GE(outcome.stops, 2);
}

TEST(HomingTrial, ArrivesFromNearTheViewWithoutDrivingAway)
{
  HomingTrialParams params;
  params.max_duration = 14.0;
  for (const auto& [name, pose] : { std::make_pair("desk", PlanarPose{ -0.02, 0.01, 0.0 }),
                                    std::make_pair("cabinet", PlanarPose{ -0.05, 0.0, 0.0 }) })
  {
    const World world = coarseWorldOf(name);
    HomingTrials trials(world, params);
    double furthest = 0.0;
    const HomingOutcome outcome = trials.run(fromGoal(world, pose), [&](const HomingStep& step) {
      furthest = std::max(furthest, compose(inverse(toPlanar(world.goal)), step.base).distance());
    });
    SCOPED_TRACE(name);
    expectArrival(outcome, 0.02, 1.0 * DEGREE);
    EXPECT_LT(furthest, 0.07);
    EXPECT_LT(outcome.travelled, 0.15);
  }
}

TEST(HomingTrial, FindsHowFarTheClocksOfOdometryAndCameraAreApart)
{
  const World world = coarseWorldOf("desk");
  for (const double delay : { 0.0, 0.05, 0.2, -0.1 })
  {
    HomingTrialParams params;
    params.conditions.odometry_delay = delay;
    HomingTrials trials(world, params);
    double found = NAN;
    const HomingOutcome outcome = trials.run(fromGoal(world, { -0.25, 0.05, 20.0 * DEGREE }),
                                             [&](const HomingStep& step) { found = step.report.odometry_delay; });
    SCOPED_TRACE(delay);
    expectArrival(outcome, 0.02, 1.0 * DEGREE);
    EXPECT_NEAR(found, delay, 0.02);
  }
}

TEST(HomingTrial, ArrivesThroughLensesThatBend)
{
  const std::pair<const char*, std::vector<double>> lenses[] = {
    { "equidistant", { 0.0, 0.0, 0.0, 0.0 } },
    { "equidistant", { 0.03, -0.006, 0.001, 0.0 } },
    { "rational_polynomial", { 0.3, -0.05, 0.0005, -0.0004, 0.0, 0.5, -0.02, 0.0 } },
    { "plumb_bob", { -0.25, 0.06, 0.001, -0.0005, 0.0 } },
  };
  for (const auto& [model, coefficients] : lenses)
  {
    World world = coarseWorldOf("desk");
    world.camera.distortion_model = model;
    world.camera.distortion = coefficients;
    HomingTrials trials(world, HomingTrialParams());
    SCOPED_TRACE(model);
    expectArrival(trials.run(fromGoal(world, { -0.4, 0.15, 5.0 * DEGREE })), 0.01, 0.5 * DEGREE);
  }
}

TEST(HomingTrial, ArrivesWhileWheelsSlip)
{
  const World world = coarseWorldOf("desk");
  const PlanarPose start = fromGoal(world, { -0.9, 0.35, 0.1 });
  for (const BaseKind base : { BaseKind::HOLONOMIC, BaseKind::DIFFERENTIAL })
  {
    HomingTrialParams params;
    params.homing.approach.base = base;
    params.conditions.slip_share = 0.3;
    params.conditions.slip_loss = 0.5;
    HomingTrials trials(world, params);
    SCOPED_TRACE(base == BaseKind::HOLONOMIC ? "holonomic" : "differential");
    expectArrival(trials.run(start), 0.02, 1.0 * DEGREE);
  }
}

// ---- as the thesis has it

TEST(HomingTrial, ThesisStopsNearTheView)
{
  // From so near, for from far away its small steps, each with its line matching, take minutes.
  const World world = coarseWorldOf("desk");
  HomingTrialParams params;
  params.homing.mode = HomingMode::THESIS;
  params.use_points = false;
  params.line_pairs = true;
  params.lines_period = 0.3;
  params.max_duration = 40.0;
  HomingTrials trials(world, params);
  const HomingOutcome outcome = trials.run(fromGoal(world, { -0.15, 0.0, 0.0 }));
  expectArrival(outcome, 0.03, 1e-9);
  EXPECT_NE(outcome.reason, "");
}

// ---- the rest

TEST(HomingTrial, SameSeedGivesTheSameWay)
{
  const World world = worldOf("cabinet");
  HomingTrialParams params;
  params.max_duration = 1.5;
  params.points_period = 0.3;
  params.use_lines = false;
  const auto way = [&] {
    HomingTrials trials(world, params);
    std::vector<double> xs;
    const HomingOutcome outcome =
        trials.run(fromGoal(world, { -0.5, 0.1, 0.0 }), [&xs](const HomingStep& step) { xs.push_back(step.base.x); });
    EXPECT_FALSE(outcome.arrived);
    EXPECT_NE(outcome.reason.find("not arrived in time"), std::string::npos);
    xs.push_back(outcome.distance_error);
    return xs;
  };
  const std::vector<double> first = way();
  EXPECT_GT(first.size(), 10U);
  EXPECT_GT(std::abs(first[first.size() - 2] - first.front()), 0.005);  // it has started
  EXPECT_EQ(first, way());
}

TEST(HomingTrial, RefusesBadParametersAndPlaces)
{
  const World world = worldOf("desk");
  HomingTrialParams params;
  params.max_duration = 0.1;
  params.homing.approach.gain = 0.0;
  params.homing.vote.bins = 1;
  HomingTrials trials(world, params);
  try
  {
    trials.run(toPlanar(world.goal));
    FAIL() << "homes with bad parameters";
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("gain"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("heading_bins"), std::string::npos) << error.what();
  }
  // In the table.
  params.homing = HomingParams();
  HomingTrials usable(world, params);
  EXPECT_THROW(usable.run({ 2.2, 0.0, 0.0 }), std::invalid_argument);
}

TEST(RandomStart, IsAPlaceFromWhichTheViewIsInSight)
{
  for (const char* name : { "desk", "corridor" })
  {
    const World world = worldOf(name);
    Nomad nomad(world, NomadParams());
    const Eigen::Isometry3d stored = nomad.cameraPose();
    Rng rng(3);
    Rng again(3);
    int ahead = 0;
    for (int i = 0; i < 8; ++i)
    {
      const PlanarPose start = randomStart(world, rng);
      const PlanarPose seen = compose(inverse(toPlanar(world.goal)), start);
      EXPECT_GE(seen.distance(), 0.4);
      EXPECT_LE(seen.distance(), 2.0);
      EXPECT_LE(std::abs(seen.yaw), 10.0 * DEGREE);
      const double direction = std::abs(seen.heading());
      EXPECT_TRUE(direction <= M_PI / 3.0 + 1e-9 || direction >= 2.0 * M_PI / 3.0 - 1e-9) << direction;
      ahead += direction < M_PI_2 ? 1 : 0;
      ASSERT_NO_THROW(nomad.setPose(planarPose(start.x, start.y, start.yaw)));
      EXPECT_GE(shareInSight(world, stored, nomad.cameraPose()), 0.3);
      const PlanarPose same = randomStart(world, again);
      EXPECT_EQ(same.x, start.x);
      EXPECT_EQ(same.yaw, start.yaw);
    }
    EXPECT_GT(ahead, 0) << name;
    EXPECT_LT(ahead, 8) << name;
  }
}

}  // namespace view_servo::sim
