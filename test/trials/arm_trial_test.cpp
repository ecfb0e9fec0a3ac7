// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/arm_trial.h"
#include "sim/world_reader.h"

#include "support/shipped_files.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
using test::pumaUrdf;

/** What table 8.1 is run with. */
ArmConditions hardConditions()
{
  ArmConditions conditions;
  conditions.image_noise = 2.0;
  conditions.encoder_noise = 1e-4;
  conditions.hand_eye_translation_error = 0.002;
  conditions.hand_eye_rotation_error = 0.5 * DEGREE;
  conditions.focal_length_error = 0.005;
  conditions.light = Light{ 0.7, 15.0, 0.4 };
  return conditions;
}

void expectAtView(const ArmOutcome& outcome)
{
  EXPECT_TRUE(outcome.converged) << outcome.reason;
  EXPECT_LT(outcome.translation_error, 0.001);
  EXPECT_LT(outcome.rotation_error, 0.1 * DEGREE);
}

}  // namespace

TEST(ArmTrial, ConvergesOnTheRice)
{
  const World world = readWorld(test::worldFile("rice"));
  ArmTrialParams params;
  ArmTrials trials(world, pumaUrdf(), params);
  const Eigen::Matrix3d k = world.camera.k;
  // The printed face, seen from the goal: 0.46 m ahead, upright.
  const auto truth = [&](const Eigen::Isometry3d& camera) -> Eigen::Matrix3d {
    const Eigen::Isometry3d motion = camera.inverse() * world.goal;
    const EuclideanHomography h{ motion.linear(), motion.translation() / 0.46, Eigen::Vector3d::UnitZ() };
    return k * h.matrix() * k.inverse();
  };
  Twist last = Twist::Zero();
  double worst = 0.0;
  int tracked = 0;
  const ArmOutcome outcome = trials.run(world.start("far"), [&](const ArmStep& step) {
    EXPECT_LE(step.sent.head<3>().norm(), params.limits.max_speed * (1.0 + 1e-9));
    EXPECT_LE(step.sent.tail<3>().norm(), params.limits.max_turn_rate * (1.0 + 1e-9));
    last = step.sent;
    if (step.track.state != TrackingState::TRACKING)
    {
      return;
    }
    ++tracked;
    for (const cv::Point& corner : { world.region.tl(), world.region.br() })
    {
      const Eigen::Vector2d point(corner.x, corner.y);
      worst = std::max(worst, (transfer(step.track.homography.h, point) - transfer(truth(step.camera), point)).norm());
    }
  });
  expectAtView(outcome);
  EXPECT_GT(tracked, 60);
  EXPECT_LT(worst, 0.5);
  EXPECT_LT(last.norm(), 0.01);
  EXPECT_LT(outcome.duration, 15.0);
}

TEST(ArmTrial, ConvergesOnTheMouseUnderHardConditionsAmongDistractors)
{
  const World world = readWorld(test::worldFile("mouse"));
  ArmTrialParams params;
  params.conditions = hardConditions();
  params.conditions.groups = { "distractors" };
  expectAtView(ArmTrials(world, pumaUrdf(), params).run(world.start("extreme")));
}

/** What it does not know it finds out, too: that the view has depth. */
TEST(ArmTrial, ConvergesOnThePartsUnderHardConditionsAmongDistractors)
{
  const World world = readWorld(test::worldFile("parts"));
  ArmTrialParams params;
  params.conditions = hardConditions();
  params.conditions.groups = { "distractors" };
  for (const Target target : { Target::SCENE, Target::AUTO })
  {
    params.target = target;
    expectAtView(ArmTrials(world, pumaUrdf(), params).run(world.start("extreme")));
  }
}

TEST(ArmTrial, ConvergesOnTheRackUnderHardConditions)
{
  const World world = readWorld(test::worldFile("rack"));
  ArmTrialParams params;
  params.conditions = hardConditions();
  params.target = Target::SCENE;
  expectAtView(ArmTrials(world, pumaUrdf(), params).run(world.start("far")));
}

/** It stands while nothing is seen, and goes on. */
TEST(ArmTrial, OutlivesACover)
{
  const World world = readWorld(test::worldFile("mouse"));
  ArmTrialParams params;
  params.conditions.covered_from = 1.5;
  double standing_from = 0.0;
  double moving_again = 0.0;
  const ArmOutcome outcome = ArmTrials(world, pumaUrdf(), params).run(world.start("near"), [&](const ArmStep& step) {
    if (step.time > 1.8 && step.time < 3.5)
    {
      EXPECT_TRUE(step.sent.isZero()) << step.time;
      EXPECT_EQ(step.report.state, ServoState::LOST) << step.time;
    }
    standing_from = standing_from == 0.0 && step.time > 1.5 && step.sent.isZero() ? step.time : standing_from;
    moving_again = moving_again == 0.0 && step.time > 3.5 && !step.sent.isZero() ? step.time : moving_again;
  });
  expectAtView(outcome);
  EXPECT_LT(standing_from - 1.5, 0.3);
  EXPECT_GT(moving_again, 0.0);
  EXPECT_LT(moving_again - 3.5, 0.2);
}

TEST(ArmTrial, GivesUpWhereTheViewIsNotInSight)
{
  const World world = readWorld(test::worldFile("rice"));
  ArmTrialParams params;
  params.servo.lost_timeout = 1.0;
  Eigen::Isometry3d away = world.goal;
  away.linear() *= Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const ArmOutcome outcome =
      ArmTrials(world, pumaUrdf(), params).run(away, [](const ArmStep& step) { EXPECT_TRUE(step.sent.isZero()); });
  EXPECT_FALSE(outcome.converged);
  EXPECT_NE(outcome.reason.find("not found"), std::string::npos) << outcome.reason;
  EXPECT_GT(outcome.rotation_error, 0.8);
}

TEST(ArmTrial, RefusesStartsOutOfReach)
{
  const World world = readWorld(test::worldFile("rice"));
  Eigen::Isometry3d far = world.goal;
  far.translation().x() -= 3.0;
  EXPECT_THROW(ArmTrials(world, pumaUrdf(), ArmTrialParams()).run(far), std::invalid_argument);
}

}  // namespace view_servo::sim
