// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Homing as the thesis has it, of a base that cannot slide, and with what is learnt of the view.
#include "homing_drive.h"

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
// ---- as the thesis has it

TEST(ThesisHoming, DrivesStepsWithoutTurning)
{
  const Walls walls;
  const PlanarPose start{ -0.4, 0.1, 0.0 };
  Drive run(walls, thesisParams(), start);
  // The first heading comes when the base is seen at rest.
  bool moved = false;
  while (!moved && run.time() < 13.0)
  {
    run.step();
    moved = run.travelled() > 0.0;
  }
  ASSERT_TRUE(moved);
  EXPECT_EQ(run.report().state, HomingState::APPROACHING);
  const double heading = std::atan2(-0.1, 0.4);
  EXPECT_NEAR(run.report().heading, heading, 3.0 * DEGREE);
  // To the end of the step, where it waits for the next heading.
  double speed = 1.0;
  while (speed > 0.0 && run.time() < 16.0)
  {
    const PlanarPose before = run.base();
    run.step();
    speed = compose(inverse(before), run.base()).distance() / CONTROL_PERIOD;
    EXPECT_LE(speed, thesisParams().step_speed + 1e-9);
  }
  const PlanarPose step = compose(inverse(start), run.base());
  EXPECT_NEAR(step.distance(), thesisParams().step, 0.005);
  EXPECT_NEAR(step.heading(), heading, 4.0 * DEGREE);
  EXPECT_EQ(step.yaw, 0.0);
}

TEST(ThesisHoming, StopsNearTheView)
{
  const Walls walls;
  Drive run(walls, thesisParams(), { -0.15, 0.02, 0.0 });
  run.runFor(40.0);
  ASSERT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_TRUE(run.report().at_view);
  EXPECT_LT(run.base().distance(), 0.03);
  EXPECT_EQ(run.base().yaw, 0.0);
  EXPECT_TRUE(run.homing().command().isZero());
}

TEST(ThesisHoming, KeepsTheDirectionOfTheStepThoughTheBaseTurns)
{
  const Walls walls;
  const PlanarPose start{ -0.4, 0.1, 0.0 };
  const auto homing = makeHoming(thesisParams(), walls.target());
  Rng rng(4);
  for (int i = 0; i < 3; ++i)
  {
    homing->addOdometry(1.0 + 0.1 * i, start);
    homing->addImage(1.0 + 0.1 * i, walls.image(start));
    homing->addMatches(1.0 + 0.1 * i, equallyTrusted(walls.matches(start, 60, 20, rng)));
  }
  const BaseVelocity before = homing->command();
  ASSERT_GT(before.norm(), 0.0);
  homing->addOdometry(1.3, { start.x, start.y, 0.3 });
  const BaseVelocity after = homing->command();
  EXPECT_NEAR(std::atan2(after.y(), after.x()), std::atan2(before.y(), before.x()) - 0.3, 1e-9);
  EXPECT_EQ(after.z(), 0.0);
}

// ---- a base that cannot slide

TEST(DifferentialHoming, ArrivesWithoutSliding)
{
  const Walls walls({ 0.1, 0.05, 0.0 });
  for (const PlanarPose& start : { PlanarPose{ -0.6, 0.2, 0.1 }, { -0.5, -0.3, -0.2 }, { 0.3, -0.1, 0.15 } })
  {
    Drive run(walls, differentialParams(), start);
    bool told = false;
    while (run.time() < 130.0 && !run.ended())
    {
      run.step();
      ASSERT_EQ(run.homing().command().y(), 0.0);
      told = told || !run.report().manoeuvre.empty();
    }
    EXPECT_EQ(run.report().state, HomingState::ARRIVED)
        << run.report().reason << ", from " << start.x << ' ' << start.y;
    EXPECT_LT(run.base().distance(), 0.01);
    EXPECT_LT(std::abs(run.base().yaw), 0.5 * DEGREE);
    EXPECT_TRUE(told);
  }
}

/** Something walks between, where the view should be in sight: the base stands, and goes on when it has passed. */
TEST(DifferentialHoming, StandsWhileTheViewIsHidden)
{
  const Walls walls;
  Drive run(walls, differentialParams(), { -0.6, 0.1, 0.0 });
  run.runFor(4.0);
  ASSERT_TRUE(run.follows()) << run.report().reason;
  ASSERT_FALSE(run.homing().command().isZero());
  const PlanarPose seen_from = run.base();
  run.runFor(3.0, Drive::Sight::NO_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_LT(compose(inverse(seen_from), run.base()).distance(), 0.06);
  run.runFor(100.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_LT(run.base().distance(), 0.01);
}

/** For a navigation stack: the truth is odometry's origin. */
TEST(ServoHoming, TellsWhereTheViewIsInMetres)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.7, 0.2, 0.05 });
  run.step();
  EXPECT_FALSE(run.report().goal_in_odom);
  double normalized = 0.0;
  int count = 0;
  while (run.time() < 60.0 && !run.ended())
  {
    run.step();
    if (const std::optional<PlanarPose>& goal = run.report().goal_in_odom)
    {
      ++count;
      EXPECT_LT(goal->distance(), 0.15);
      const Eigen::Vector2d error(goal->x, goal->y);
      normalized += error.dot(run.report().goal_covariance.topLeftCorner<2, 2>().inverse() * error);
    }
  }
  EXPECT_GT(count, 20);
  EXPECT_LT(normalized / count, 20.0);
  EXPECT_GT(normalized / count, 0.02);
  ASSERT_TRUE(run.report().goal_in_odom);
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.003);
}

/** In the view's camera: below the horizon on a wall 1.8 m away, above it on one 3.5 m away. */
TEST(ServoHoming, TellsWhereTheThingsAreThatTheViewShows)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.7, 0.2, 0.05 });
  run.step();
  EXPECT_TRUE(run.homing().landmarks().empty());
  run.runFor(60.0);
  ASSERT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  const std::vector<HomingLandmark> landmarks = run.homing().landmarks();
  ASSERT_GT(landmarks.size(), 30U);
  int in_place = 0;
  int supporting = 0;
  for (const HomingLandmark& landmark : landmarks)
  {
    const double wall = landmark.position.y() > 0.0 ? 1.8 : 3.5;
    in_place += std::abs(landmark.position.z() / wall - 1.0) < 0.15 ? 1 : 0;
    supporting += landmark.supporting ? 1 : 0;
  }
  EXPECT_GT(in_place, 0.8 * static_cast<double>(landmarks.size()));
  EXPECT_GT(supporting, 0.6 * static_cast<double>(landmarks.size()));
}

TEST(ServoHoming, LearnsWhereTheViewIsWhenItIsDrivenAwayFromThere)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.dwell = 1e3;  // nobody wants it to arrive
  Drive run(walls, params, {});
  run.push(BaseVelocity::Zero());
  run.runFor(2.0);
  EXPECT_FALSE(run.report().goal_in_odom);
  run.push({ -0.15, 0.03, 0.0 });
  run.runFor(4.0);
  EXPECT_NEAR(run.base().x, -0.6, 0.02);
  ASSERT_TRUE(run.report().goal_in_odom) << run.report().reason;
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.03);
  EXPECT_GE(run.homing().structure().points.size(), 30U);
}

TEST(ServoHoming, KnowsTheDistanceFromTheFirstMatchesOnOnceTheViewIsLearnt)
{
  const Walls walls;
  Drive lesson(walls, servoParams(), { -0.7, 0.2, 0.05 });
  EXPECT_TRUE(lesson.homing().structure().points.empty());
  lesson.runFor(60.0);
  ASSERT_EQ(lesson.report().state, HomingState::ARRIVED);
  HomingTarget target = walls.target();
  target.structure = lesson.homing().structure();
  EXPECT_GE(target.structure.points.size(), 30U);

  Drive run(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  run.runFor(0.6);  // two images after the first matches
  ASSERT_TRUE(run.report().goal_in_odom) << run.report().reason;
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.03);
  EXPECT_LT(std::abs(run.report().goal_in_odom->yaw), 0.5 * DEGREE);
  run.runFor(60.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED);
  EXPECT_LT(run.base().distance(), 0.005);

  // What is wrong now is not used for long: the view's points are nowhere near where it has them.
  for (StructurePoint& point : target.structure.points)
  {
    point.inverse_depth = point.pixel.x() < 160.0 ? 0.1 : 5.0;
  }
  Drive misled(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  misled.runFor(60.0);
  EXPECT_EQ(misled.report().state, HomingState::ARRIVED) << misled.report().reason;
  EXPECT_LT(misled.base().distance(), 0.01);  // as much as moves the view's points by 1.5 px
}

TEST(ServoHoming, ForgetsPointsThatAreNotSeenAtTheView)
{
  const Walls walls;
  Drive lesson(walls, servoParams(), { -0.7, 0.2, 0.05 });
  lesson.runFor(60.0);
  HomingTarget target = walls.target();
  target.structure = lesson.homing().structure();
  // Two things that have gone since the view was stored.
  target.image = target.image.clone();
  const std::vector<Eigen::Vector2d> gone = { { 101.0, 121.0 }, { 201.0, 61.0 } };
  for (const Eigen::Vector2d& at : gone)
  {
    const cv::Rect place(cv::Point2d(at.x() - 20.0, at.y() - 20.0), cv::Size(41, 41));
    test::texturedPicture(33, place.size()).copyTo(target.image(place));
    target.structure.points.push_back({ at, 1.0 / 1.8, 0.003 });
  }
  const auto moved = [&gone](const StructurePoint& point) {
    return std::any_of(gone.begin(), gone.end(),
                       [&](const Eigen::Vector2d& at) { return (point.pixel - at).norm() < 1.0; });
  };
  Drive run(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  run.runFor(60.0);
  ASSERT_EQ(run.report().state, HomingState::ARRIVED);
  const ViewStructure learnt = run.homing().structure();
  EXPECT_GE(learnt.points.size(), 30U);
  EXPECT_EQ(std::count_if(learnt.points.begin(), learnt.points.end(), moved), 0);
}

}  // namespace view_servo
