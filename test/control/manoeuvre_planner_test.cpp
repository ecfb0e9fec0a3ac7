// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/manoeuvre_planner.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

namespace view_servo
{
namespace
{
double all(const PlanarPose& /*base_in_goal*/)
{
  return 1.0;
}

/** Of a wall 2.5 m ahead of the goal, seen with 63 degrees: the part of it that is still in the image. */
double ofAWall(const PlanarPose& base)
{
  constexpr double DEPTH = 2.5;
  constexpr double HALF_FIELD = 31.5 * DEGREE;
  constexpr int COLUMNS = 100;
  int in_sight = 0;
  for (int i = 0; i < COLUMNS; ++i)
  {
    const double y = DEPTH * std::tan(HALF_FIELD) * (2.0 * (i + 0.5) / COLUMNS - 1.0);
    const double angle = wrapAngle(std::atan2(y - base.y, DEPTH - base.x) - base.yaw);
    in_sight += base.x < DEPTH && std::abs(angle) < HALF_FIELD ? 1 : 0;
  }
  return static_cast<double>(in_sight) / COLUMNS;
}

/** Where the base is after the legs, by what they say of how it drives; NaN when a leg contradicts itself. */
PlanarPose driven(PlanarPose base, const Manoeuvre& manoeuvre)
{
  for (const Leg& leg : manoeuvre.legs)
  {
    const double length = std::hypot(leg.end.x - base.x, leg.end.y - base.y);
    base.yaw = leg.end.yaw;
    base = compose(base, { leg.backwards ? -length : length, 0.0, 0.0 });
    if (std::hypot(leg.end.x - base.x, leg.end.y - base.y) > 0.01)
    {
      return { NAN, NAN, NAN };
    }
  }
  return base;
}

PlanarPose arbitraryStart()
{
  const double distance = *rc::gen::inRange(40, 200) / 100.0;
  const double direction = *rc::gen::inRange(-60, 61) * DEGREE;
  const double sense = *rc::gen::arbitrary<bool>() ? 1.0 : -1.0;
  return { sense * distance * std::cos(direction), distance * std::sin(direction),
           *rc::gen::inRange(-20, 21) * DEGREE };
}

RC_GTEST_PROP(ManoeuvrePlanner, LeadsToTheGoalAlongItsAxis, ())
{
  const PlanarPose start = arbitraryStart();
  const ManoeuvreParams params;
  const Manoeuvre manoeuvre = planManoeuvre(start, all, params);
  RC_ASSERT(!manoeuvre.legs.empty());
  const PlanarPose end = driven(start, manoeuvre);
  RC_ASSERT(end.distance() < 0.02);
  RC_ASSERT(std::abs(end.yaw) < 0.05);
  for (const Leg& leg : manoeuvre.legs)
  {
    RC_ASSERT(leg.end.x >= std::min(start.x, 0.0) - params.max_retreat - 1e-9);
    RC_ASSERT(std::abs(leg.end.yaw) <= M_PI_2 + 1e-9);
  }
}

RC_GTEST_PROP(ManoeuvrePlanner, KeepsTheViewInSightWhereThatCanBe, ())
{
  const PlanarPose start = arbitraryStart();
  RC_PRE(ofAWall(start) >= 0.3);
  const Manoeuvre manoeuvre = planManoeuvre(start, ofAWall, ManoeuvreParams());
  RC_ASSERT(!manoeuvre.legs.empty());
  RC_ASSERT(manoeuvre.least_share >= std::min(0.3, ofAWall(start)));
  RC_ASSERT(manoeuvre.blind_distance == 0.0);
}

TEST(ManoeuvrePlanner, EndsSoonHoweverFarAwayTheGoalIs)
{
  for (const PlanarPose& start :
       { PlanarPose{ -4.0, 1.0, 0.3 }, PlanarPose{ -20.0, 10.0, 0.4 }, PlanarPose{ -500.0, 300.0, 0.2 } })
  {
    for (const double seen : { 0.0, 0.2, 1.0 })
    {
      int looks = 0;
      const Manoeuvre manoeuvre = planManoeuvre(
          start,
          [&](const PlanarPose&) {
            ++looks;
            return seen;
          },
          ManoeuvreParams());
      EXPECT_LT(looks, 10000) << start.x;
      EXPECT_EQ(manoeuvre.legs.empty(), seen < 0.15) << start.x << ", " << seen;
    }
  }
}

TEST(ManoeuvrePlanner, DrivesStraightAheadFromBehind)
{
  const Manoeuvre manoeuvre = planManoeuvre({ -1.0, 0.0, 0.0 }, ofAWall, ManoeuvreParams());
  ASSERT_EQ(manoeuvre.legs.size(), 1U);
  EXPECT_FALSE(manoeuvre.legs.front().backwards);
  EXPECT_EQ(manoeuvre.legs.front().end.distance(), 0.0);
  EXPECT_NEAR(manoeuvre.duration, 1.0 / 0.25 + 1.0, 1e-9);
}

TEST(ManoeuvrePlanner, DrivesStraightBackFromAhead)
{
  const Manoeuvre manoeuvre = planManoeuvre({ 0.7, 0.0, 0.0 }, ofAWall, ManoeuvreParams());
  ASSERT_EQ(manoeuvre.legs.size(), 1U);
  EXPECT_TRUE(manoeuvre.legs.front().backwards);
}

TEST(ManoeuvrePlanner, TakesAwayAnErrorAcross)
{
  const Manoeuvre manoeuvre = planManoeuvre({ 0.0, 0.02, 0.0 }, ofAWall, ManoeuvreParams());
  ASSERT_EQ(manoeuvre.legs.size(), 2U);
  EXPECT_NEAR(std::abs(manoeuvre.legs.front().end.x), ManoeuvreParams().straight_end, 1e-9);
  EXPECT_EQ(manoeuvre.legs.front().end.y, 0.0);
  EXPECT_LT(manoeuvre.duration, 12.0);
}

TEST(ManoeuvrePlanner, RefusesAWayThatIsBlindForLong)
{
  const auto nothing = [](const PlanarPose&) {
    return 0.0;
  };
  EXPECT_TRUE(planManoeuvre({ -1.0, 0.5, 0.0 }, nothing, ManoeuvreParams()).legs.empty());
}

/** There is a stretch from which nothing is seen: it is crossed where it is short, and gone around where it is long. */
TEST(ManoeuvrePlanner, CrossesOnlyAShortBlindStretch)
{
  for (const double length : { 0.2, 0.8 })
  {
    const auto share = [length](const PlanarPose& base) {
      return base.x > -0.9 && base.x < -0.9 + length && std::abs(base.y) < 10.0 ? 0.0 : 1.0;
    };
    const Manoeuvre manoeuvre = planManoeuvre({ -1.5, 0.0, 0.0 }, share, ManoeuvreParams());
    EXPECT_EQ(manoeuvre.legs.empty(), length > ManoeuvreParams().max_blind_distance) << length;
    EXPECT_LE(manoeuvre.blind_distance, ManoeuvreParams().max_blind_distance);
  }
}

}  // namespace
}  // namespace view_servo
