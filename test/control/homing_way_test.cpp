// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// The whole way to the view, and what homing does when the view is lost on it.
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
namespace
{
std::string nameOf(Drive::Sight sight)
{
  switch (sight)
  {
    case Drive::Sight::WALLS:
      return "Walls";
    case Drive::Sight::NO_MATCHES:
      return "NoMatches";
    case Drive::Sight::RANDOM_MATCHES:
      return "RandomMatches";
    case Drive::Sight::WRONG_MATCHES:
      return "WrongMatches";
    case Drive::Sight::UNMATCHED:
      return "Unmatched";
    case Drive::Sight::NOISY:
      return "Noisy";
    case Drive::Sight::BLANK:
      return "Blank";
    case Drive::Sight::COPY:
      return "Copy";
    case Drive::Sight::FROZEN:
      return "Frozen";
  }
  return "";
}

}  // namespace

// ---- the whole way

TEST(Homing, Arrives)
{
  const std::vector<std::pair<PlanarPose, PlanarPose>> cases{ { {}, { -0.5, -0.3, 0.12 } },
                                                              { { 0.2, -0.1, 0.3 }, { 0.3, 0.1, -0.1 } } };
  for (const auto& [on_base, start] : cases)
  {
    const Walls walls(on_base);
    Drive run(walls, servoParams(), start);
    run.runFor(40.0);
    ASSERT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
    EXPECT_TRUE(run.report().at_view);
    EXPECT_LE(run.report().distance, servoParams().approach.distance_tolerance);
    EXPECT_LE(std::abs(run.report().yaw_error), servoParams().approach.yaw_tolerance);
    EXPECT_LT(run.base().distance(), 0.008);
    EXPECT_LT(std::abs(run.base().yaw), 0.4 * DEGREE);
    EXPECT_LT(run.travelled(), 1.5 * start.distance());
    EXPECT_GT(run.report().similarity, 0.9);
    // It has ended: whatever comes.
    EXPECT_TRUE(run.homing().command().isZero());
    for (int i = 0; i < 10; ++i)
    {
      run.step(Drive::Sight::BLANK);
    }
    EXPECT_EQ(run.report().state, HomingState::ARRIVED);
    EXPECT_TRUE(run.homing().command().isZero());
  }
}

TEST(Homing, ReportsTheWayThatIsLeft)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.6, -0.3, 0.1 });
  run.runFor(1.2);
  int compared = 0;
  while (run.base().distance() > 0.1 && run.time() < 30.0)
  {
    const PlanarPose goal = inverse(run.base());  // which the next image is taken from
    run.step();
    EXPECT_NEAR(run.report().heading, goal.heading(), 4.0 * DEGREE);
    EXPECT_NEAR(run.report().yaw_error, goal.yaw, 1.0 * DEGREE);
    EXPECT_LE(run.report().roi_min, run.report().heading);
    EXPECT_GE(run.report().roi_max, run.report().heading);
    EXPECT_FALSE(run.report().at_view);
    EXPECT_TRUE(run.follows());
    if (run.travelled() > 0.3)
    {
      EXPECT_NEAR(run.report().distance, goal.distance(), 0.4 * goal.distance());  // odometry has told the scale
      ++compared;
    }
    run.runFor(0.15);
  }
  EXPECT_GT(compared, 3);
}

TEST(Homing, StatesFollowTheDisplacement)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.6, -0.1, 0.1 });
  std::vector<HomingState> states{ HomingState::ACQUIRING };
  while (states.back() != HomingState::DOCKING && run.time() < 40.0)
  {
    run.step();
    if (run.report().state != states.back())
    {
      states.push_back(run.report().state);
    }
  }
  EXPECT_LE(run.report().displacement, servoParams().docking_displacement);
  EXPECT_GT(run.report().displacement, 0.7 * servoParams().docking_displacement);
  EXPECT_EQ(states, (std::vector<HomingState>{ HomingState::ACQUIRING, HomingState::APPROACHING, HomingState::NEAR,
                                               HomingState::DOCKING }));
}

TEST(Homing, EndsOnlyWhereTheViewsAreSimilar)
{
  // Noise makes the images less alike than the place is: whether that will do is a question of the parameter.
  const Walls walls;
  for (const double least : { 0.3, 0.97 })
  {
    HomingParams params = servoParams();
    params.min_similarity = least;
    params.approach.distance_tolerance = 0.01;
    params.approach.yaw_tolerance = 0.01;
    Drive run(walls, params, { -0.2, 0.05, 0.0 });
    run.runFor(6.0, Drive::Sight::NOISY);
    EXPECT_GT(run.report().similarity, 0.3);
    EXPECT_LT(run.report().similarity, 0.97) << run.report().distance;
    EXPECT_LT(run.base().distance(), 0.02);
    EXPECT_EQ(run.report().state == HomingState::ARRIVED, least == 0.3) << run.report().reason;
    EXPECT_EQ(run.report().at_view, least == 0.3);
  }
}

TEST(Homing, StaysAtTheViewUntilItMayEnd)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.dwell = 4.0;
  Drive run(walls, params, { -0.2, 0.05, 0.0 });
  while (run.base().distance() > 0.008 && run.time() < 30.0)
  {
    run.step();
  }
  ASSERT_TRUE(run.follows());
  double furthest = 0.0;
  const double since = run.time();
  while (!run.ended() && run.time() < since + 8.0)
  {
    run.step();
    furthest = std::max(furthest, run.base().distance());
  }
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_GT(run.time() - since, params.dwell - 0.3);  // it cannot have been within the tolerances for long before
  EXPECT_LT(furthest, 0.015);
}

TEST(Homing, StaysWhereItIsWhenItStartsAtTheView)
{
  const Walls walls;
  for (const PlanarPose& start : { PlanarPose{}, PlanarPose{ -0.03, 0.01, 0.0 } })
  {
    Drive run(walls, servoParams(), start);
    run.runFor(12.0);
    EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
    EXPECT_LT(run.travelled(), 0.03 + 2.0 * start.distance());
  }
}

// ---- when the view is lost

TEST(Homing, WaitsWhileTheImageIsBlankAndGoesOn)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.5, 0.1, 0.0 });
  run.runFor(2.0);
  ASSERT_TRUE(run.follows());
  run.runFor(0.5, Drive::Sight::BLANK);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_NE(run.report().reason, "");
  const double travelled = run.travelled();
  run.runFor(2.0, Drive::Sight::BLANK);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_EQ(run.travelled(), travelled);
  run.runFor(40.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
}

class HomingLostViewTest : public ::testing::TestWithParam<Drive::Sight>
{
};

TEST_P(HomingLostViewTest, StopsTheBaseAndEndsHoming)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.lost_timeout = 2.0;
  Drive run(walls, params, { -0.6, 0.2, 0.0 });
  run.runFor(1.5);
  ASSERT_TRUE(run.follows());
  ASSERT_FALSE(run.homing().command().isZero());
  run.runFor(1.2, GetParam());
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_TRUE(run.homing().command().isZero());
  EXPECT_GE(run.report().confidence, 0.0);
  EXPECT_LE(run.report().confidence, 1.0);
  run.runFor(2.5, GetParam());
  EXPECT_EQ(run.report().state, HomingState::FAILED);
  EXPECT_EQ(run.report().reason, "the view was lost");
  EXPECT_TRUE(run.homing().command().isZero());
}

INSTANTIATE_TEST_SUITE_P(Homing, HomingLostViewTest,
                         ::testing::Values(Drive::Sight::BLANK, Drive::Sight::NO_MATCHES, Drive::Sight::RANDOM_MATCHES),
                         [](const auto& sight) { return nameOf(sight.param); });

TEST(Homing, NeedsNoMatchesWhileTheViewIsTracked)
{
  const Walls walls;
  for (const Drive::Sight sight : { Drive::Sight::WRONG_MATCHES, Drive::Sight::UNMATCHED })
  {
    Drive run(walls, servoParams(), { -0.7, 0.1, 0.0 });
    run.runFor(2.0);
    ASSERT_TRUE(run.follows());
    ASSERT_GT(run.base().distance(), 0.25);
    run.runFor(15.0, sight);
    EXPECT_EQ(run.report().state, HomingState::ARRIVED) << nameOf(sight) << ": " << run.report().reason;
    EXPECT_LT(run.base().distance(), 0.01) << nameOf(sight);
  }
}

}  // namespace view_servo
