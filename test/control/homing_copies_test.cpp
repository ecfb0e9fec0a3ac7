// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// What looks like the view and is not: it does not move as the base does.
#include "homing_drive.h"

#include <gtest/gtest.h>

#include <string>

namespace view_servo
{
namespace
{
HomingParams paramsOf(BaseKind base)
{
  return base == BaseKind::HOLONOMIC ? servoParams() : differentialParams();
}

/** Drives until it follows the view and is nearer to it than a distance [m]. */
void approach(Drive& run, double distance)
{
  while (!(run.follows() && run.base().distance() < distance) && run.time() < 60.0 && !run.ended())
  {
    run.step();
  }
  ASSERT_TRUE(run.follows()) << run.report().reason;
}

}  // namespace

class HomingCopiesTest : public testing::TestWithParam<BaseKind>
{
};

TEST_P(HomingCopiesTest, DoesNotArriveAtAPictureHeldBeforeTheCamera)
{
  const Walls walls;
  for (const double distance : { 0.55, 0.46, 0.4, 0.3, 0.2, 0.1, 0.05, 0.03 })
  {
    Drive run(walls, paramsOf(GetParam()), { -0.5, -0.2, 0.1 });
    approach(run, distance);
    const PlanarPose before = run.base();
    run.runFor(45.0, Drive::Sight::COPY);
    EXPECT_EQ(run.report().state, HomingState::FAILED) << distance << ": " << run.report().reason;
    EXPECT_FALSE(run.report().reason.empty());
    EXPECT_LT(compose(inverse(before), run.base()).distance(), 0.15) << distance;
  }
}

TEST_P(HomingCopiesTest, DoesNotArriveAtAPictureThatComesAfterTheViewWasOutOfSight)
{
  const Walls walls;
  for (const double distance : { 0.5, 0.4, 0.3, 0.2, 0.1 })
  {
    Drive run(walls, paramsOf(GetParam()), { -0.5, -0.2, 0.1 });
    approach(run, distance);
    run.runFor(1.5, Drive::Sight::NO_MATCHES);
    const PlanarPose before = run.base();
    run.runFor(45.0, Drive::Sight::COPY);
    EXPECT_EQ(run.report().state, HomingState::FAILED) << distance << ": " << run.report().reason;
    EXPECT_LT(compose(inverse(before), run.base()).distance(), 0.15) << distance;
  }
}

TEST_P(HomingCopiesTest, GoesOnWhenThePictureIsTakenAway)
{
  const Walls walls;
  for (const double distance : { 0.46, 0.4, 0.3, 0.2, 0.1 })
  {
    Drive run(walls, paramsOf(GetParam()), { -0.5, -0.2, 0.1 });
    approach(run, distance);
    run.runFor(4.0, Drive::Sight::COPY);
    EXPECT_FALSE(run.report().at_view);
    run.runFor(60.0);
    EXPECT_EQ(run.report().state, HomingState::ARRIVED) << distance << ": " << run.report().reason;
    EXPECT_LT(run.base().distance(), 0.02);
  }
}

TEST_P(HomingCopiesTest, StandsWhenTheCameraSendsOneImageAgainAndAgain)
{
  constexpr double FARTHEST = 0.4;  // [m]
  const Walls walls;
  for (const double distance : { 0.55, 0.4, 0.2, 0.1 })
  {
    Drive run(walls, paramsOf(GetParam()), { -0.6, -0.2, 0.1 });
    approach(run, distance);
    const PlanarPose before = run.base();
    run.runFor(40.0, Drive::Sight::FROZEN);
    EXPECT_EQ(run.report().state, HomingState::FAILED) << distance << ": " << run.report().reason;
    EXPECT_TRUE(run.report().contradicted) << run.report().reason;
    EXPECT_LT(compose(inverse(before), run.base()).distance(), FARTHEST) << distance << ": " << run.report().reason;
  }
}

TEST_P(HomingCopiesTest, ArrivesWhereItWasCarriedAfterItHasSeenTheViewMove)
{
  const Walls walls;
  Drive run(walls, paramsOf(GetParam()), { -0.5, -0.2, 0.1 });
  approach(run, 0.3);
  run.carryTo({ 0.001, 0.0, 0.001 });
  run.runFor(60.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_LT(run.base().distance(), 0.02);
  EXPECT_GT(run.travelled(), 0.2);
}

TEST_P(HomingCopiesTest, DoesNotAskABaseOnAStand)
{
  const Walls walls;
  HomingParams params = paramsOf(GetParam());
  params.check_motion = false;
  Drive run(walls, params, { -0.5, -0.2, 0.1 });
  approach(run, 0.4);
  run.runFor(10.0, Drive::Sight::COPY);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
}

INSTANTIATE_TEST_SUITE_P(Bases, HomingCopiesTest, testing::Values(BaseKind::HOLONOMIC, BaseKind::DIFFERENTIAL),
                         [](const auto& base) {
                           return std::string(base.param == BaseKind::HOLONOMIC ? "Holonomic" : "Differential");
                         });

}  // namespace view_servo
