// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// What homing refuses, and what it does until it knows where to go.
#include "homing_drive.h"

#include "support/thrown_message.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
std::string messageOf(const HomingParams& params, const HomingTarget& target)
{
  return test::thrownMessage<std::invalid_argument>([&] { makeHoming(params, target); });
}

}  // namespace

// ---- what is refused

TEST(MakeHoming, RefusesBadParametersNamingAllFaults)
{
  const Walls walls;
  HomingParams params;
  params.vote.bins = 0;
  params.hypotheses.memory = 2.0;
  params.arrival.drop = 0.0;
  params.tracker.window = 20;
  params.lost_timeout = 0.0;
  params.approach.gain = -1.0;
  params.approach.turn_gain = 0.0;
  params.blind_speed = 0.0;
  params.approach.distance_tolerance = 0.0;
  params.approach.yaw_tolerance = 0.0;
  params.dwell = -0.1;
  params.arrival_distance = 0.0;
  params.arrival_yaw = 0.0;
  params.docking_displacement = 0.0;
  params.min_similarity = 1.0;
  params.step = 0.0;
  params.near_step = 0.0;
  params.step_speed = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 18U);
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    params.mode = mode;
    const std::string message = messageOf(params, walls.target());
    for (const char* name :
         { "heading_bins", "memory", "arrival_drop", "tracking_window", "lost_timeout", "\n  gain", "turn_gain",
           "blind_speed", "distance_tolerance", "yaw_tolerance", "dwell", "arrival_distance", "arrival_yaw",
           "docking_displacement", "min_similarity", "\n  step ", "near_step", "step_speed" })
    {
      EXPECT_NE(message.find(name), std::string::npos) << name << " in: " << message;
    }
  }
  EXPECT_TRUE(HomingParams().validate().empty());
}

TEST(MakeHoming, RefusesATargetThatLacksSomething)
{
  const Walls walls;
  EXPECT_EQ(messageOf(HomingParams(), walls.target()), "");
  HomingTarget target = walls.target();
  target.camera.k.setZero();
  EXPECT_NE(messageOf(HomingParams(), target).find("calibrated"), std::string::npos);
  target = walls.target();
  target.image = cv::Mat();
  EXPECT_NE(messageOf(HomingParams(), target).find("image"), std::string::npos);
  target.image = cv::Mat(240, 320, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_NE(messageOf(HomingParams(), target).find("grey"), std::string::npos);
}

TEST(MakeHoming, RefusesTheThesisWayForABaseThatCannotSlide)
{
  const Walls walls;
  HomingParams params = differentialParams();
  params.mode = HomingMode::THESIS;
  EXPECT_NE(messageOf(params, walls.target()).find("it needs base: holonomic"), std::string::npos);
}

TEST(Homing, RefusesImagesOfAnotherSize)
{
  const Walls walls;
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    const auto homing = makeHoming(params, walls.target());
    homing->addOdometry(1.0, {});
    EXPECT_THROW(homing->addImage(1.0, test::texturedPicture(1, cv::Size(Walls::WIDTH, Walls::HEIGHT - 2))),
                 std::invalid_argument);
    EXPECT_NO_THROW(homing->addImage(1.1, test::texturedPicture(1, cv::Size(Walls::WIDTH, Walls::HEIGHT))));
  }
}

// ---- before anything is known

TEST(Homing, StandsStillUntilItKnowsWhereToGo)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.0 };
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    const auto homing = makeHoming(params, walls.target());
    EXPECT_TRUE(homing->command().isZero());
    EXPECT_EQ(homing->report().state, HomingState::ACQUIRING);
    EXPECT_TRUE(std::isnan(homing->report().heading));
    EXPECT_TRUE(std::isnan(homing->report().distance));
    homing->addOdometry(1.0, base);
    EXPECT_TRUE(homing->command().isZero());
    for (int i = 0; i < 5; ++i)
    {
      homing->addOdometry(1.1 + 0.1 * i, base);
      homing->addImage(1.1 + 0.1 * i, walls.image(base));
      EXPECT_TRUE(homing->command().isZero());
      EXPECT_EQ(homing->report().state, HomingState::ACQUIRING);
      EXPECT_EQ(homing->report().stamp, 1.1 + 0.1 * i);
    }
  }
}

TEST(Homing, MatchesWithoutOdometryOfTheirTimeSayNothing)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.0 };
  const auto homing = makeHoming(HomingParams(), walls.target());
  Rng rng(1);
  for (int i = 0; i < 5; ++i)
  {
    homing->addMatches(0.5 + 0.1 * i, equallyTrusted(walls.matches(base, 60, 0, rng)));
  }
  homing->addOdometry(1.0, base);
  for (int i = 0; i < 5; ++i)
  {
    homing->addMatches(0.5 + 0.1 * i, equallyTrusted(walls.matches(base, 60, 0, rng)));
  }
  EXPECT_TRUE(homing->command().isZero());
  EXPECT_TRUE(homing->report().histogram.empty());
}

TEST(Homing, RandomMatchesAreNotFollowed)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.5, 0.2, 0.0 });
  run.runFor(8.0, Drive::Sight::RANDOM_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::ACQUIRING);
  EXPECT_EQ(run.travelled(), 0.0);
  EXPECT_FALSE(run.report().at_view);
  run.runFor(4.0, Drive::Sight::RANDOM_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::FAILED);
  EXPECT_EQ(run.report().reason, "the view was not found");
  EXPECT_EQ(run.travelled(), 0.0);
}

TEST(Homing, GivesUpWhenTheViewIsNotFound)
{
  const Walls walls;
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    params.lost_timeout = 3.0;
    Drive run(walls, params, { -0.5, 0.2, 0.0 });
    run.runFor(2.5, Drive::Sight::NO_MATCHES);
    EXPECT_EQ(run.report().state, HomingState::ACQUIRING);
    run.runFor(2.0, Drive::Sight::NO_MATCHES);
    EXPECT_EQ(run.report().state, HomingState::FAILED) << (mode == HomingMode::THESIS ? "thesis" : "servo");
    EXPECT_NE(run.report().reason, "");
    EXPECT_EQ(run.travelled(), 0.0);
  }
}

// ---- by matches alone

TEST(Homing, OneSetOfMatchesIsNotFollowed)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.1 };
  const auto homing = makeHoming(HomingParams(), walls.target());
  Rng rng(2);
  homing->addOdometry(1.0, base);
  homing->addImage(1.0, walls.image(base));
  homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
  EXPECT_TRUE(homing->command().isZero());
  homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
  homing->addImage(1.0, walls.image(base));
  EXPECT_FALSE(homing->command().isZero());
}

TEST(Homing, MatchesGiveTheDirectionInBaseLink)
{
  // Also of a camera that looks to the left and is not in the middle of the base.
  for (const PlanarPose& on_base : { PlanarPose{}, PlanarPose{ 0.2, -0.1, 0.6 } })
  {
    const Walls walls(on_base);
    const PlanarPose base{ -0.5, -0.3, 0.15 };
    const PlanarPose goal = inverse(base);  // seen from the base
    HomingParams params;
    params.hypotheses.assumed_distance = walls.target().mount.ofCamera(goal).distance();
    const auto homing = makeHoming(params, walls.target());
    Rng rng(3);
    homing->addOdometry(1.0, base);
    for (int i = 0; i < 2; ++i)
    {
      homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
    }
    // In this image the view's points are not found.
    homing->addImage(1.0, test::texturedPicture(99, cv::Size(Walls::WIDTH, Walls::HEIGHT)));
    EXPECT_EQ(homing->report().state, HomingState::APPROACHING);
    const BaseVelocity command = homing->command();
    EXPECT_NEAR(std::atan2(command.y(), command.x()), goal.heading(), 2.0 * DEGREE);
    EXPECT_NEAR(command.head<2>().norm(), params.blind_speed, 1e-9);
    EXPECT_NEAR(command.z(), params.approach.turn_gain * goal.yaw, 0.5 * DEGREE);
    const std::vector<double>& votes = homing->report().histogram;
    ASSERT_EQ(votes.size(), static_cast<std::size_t>(params.vote.bins));
    // They are cast by the camera, which need not move as the base does where both turn.
    const double voted =
        M_PI * (std::max_element(votes.begin(), votes.end()) - votes.begin()) / static_cast<double>(votes.size() - 1) -
        0.5 * M_PI;
    const double expected = on_base.yaw + walls.target().mount.ofCamera(goal).heading();
    EXPECT_NEAR(std::remainder(voted - expected, M_PI), 0.0, 2.0 * DEGREE);
    EXPECT_NEAR(homing->report().heading, goal.heading(), 2.0 * DEGREE);
    EXPECT_NEAR(homing->report().yaw_error, goal.yaw, 0.5 * DEGREE);
    EXPECT_GT(homing->report().confidence, 0.7);
    EXPECT_LE(homing->report().confidence, 1.0);
  }
}

}  // namespace view_servo
