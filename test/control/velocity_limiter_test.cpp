// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/numbers.h"

#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double DT = 0.05;  // [s]

/** What remains after many steps. */
BaseVelocity settled(BaseVelocityLimiter& limiter, const BaseVelocity& wanted)
{
  BaseVelocity velocity = BaseVelocity::Zero();
  for (int i = 0; i < 200; ++i)
  {
    velocity = limiter.next(wanted, DT);
  }
  return velocity;
}

}  // namespace

TEST(VelocityLimiter, GivesWhatIsAllowed)
{
  BaseVelocityLimiter limiter{ VelocityLimits() };
  const BaseVelocity wanted(0.1, -0.05, 0.3);
  EXPECT_TRUE(settled(limiter, wanted).isApprox(wanted, 1e-9));
  EXPECT_LT(settled(limiter, BaseVelocity::Zero()).norm(), 1e-12);
}

TEST(VelocityLimiter, ScalesTheWholeVelocity)
{
  const VelocityLimits limits;
  BaseVelocityLimiter limiter(limits);
  // Too fast by 4, its turn by less.
  const BaseVelocity fast(0.6, -0.8, 0.4);
  EXPECT_TRUE(settled(limiter, fast).isApprox(0.25 * fast, 1e-9));
  // Turns too fast by 5.
  const BaseVelocity turning(0.2, 0.1, -2.0);
  EXPECT_TRUE(settled(limiter, turning).isApprox(0.2 * turning, 1e-9));
}

TEST(VelocityLimiter, KeepsTheDirectionWhileGatheringSpeed)
{
  BaseVelocityLimiter limiter{ VelocityLimits() };
  const BaseVelocity wanted(0.12, 0.16, -0.3);
  for (int i = 1; i <= 5; ++i)
  {
    const BaseVelocity velocity = limiter.next(wanted, DT);
    EXPECT_NEAR(velocity.head<2>().norm(), 0.5 * DT * i, 1e-12);  // as fast as the acceleration allows
    EXPECT_LT(velocity.normalized().cross(wanted.normalized()).norm(), 1e-9);
  }
}

TEST(VelocityLimiter, TurnsAccelerateByTheirOwnLimit)
{
  VelocityLimits limits;
  limits.max_turn_acceleration = 0.2;
  BaseVelocityLimiter limiter(limits);
  EXPECT_NEAR(limiter.next({ 0.0, 0.0, 0.4 }, DT).z(), 0.2 * DT, 1e-12);
  limiter.stop();
  // Then the drive waits for the turn.
  const BaseVelocity both = limiter.next({ 0.2, 0.0, 0.4 }, DT);
  EXPECT_NEAR(both.z(), 0.2 * DT, 1e-12);
  EXPECT_NEAR(both.x(), 0.1 * DT, 1e-12);
}

RC_GTEST_PROP(VelocityLimiter, KeepsItsLimitsWhateverIsWanted, (std::uint64_t seed))
{
  Rng rng(seed);
  VelocityLimits limits;
  limits.max_speed = uniform(rng, 0.05, 1.0);
  limits.max_turn_rate = uniform(rng, 0.05, 1.0);
  limits.max_acceleration = uniform(rng, 0.05, 2.0);
  limits.max_turn_acceleration = uniform(rng, 0.05, 2.0);
  BaseVelocityLimiter limiter(limits);
  BaseVelocity last = BaseVelocity::Zero();
  for (int i = 0; i < 100; ++i)
  {
    const double scale = std::pow(10.0, uniform(rng, -3.0, 2.0));
    const double x = scale * gaussian(rng);
    const double y = scale * gaussian(rng);
    const double dt = uniform(rng, 0.001, 0.2);
    const BaseVelocity velocity = limiter.next({ x, y, scale * gaussian(rng) }, dt);
    RC_ASSERT(velocity.head<2>().norm() <= limits.max_speed * (1.0 + 1e-9));
    RC_ASSERT(std::abs(velocity.z()) <= limits.max_turn_rate * (1.0 + 1e-9));
    RC_ASSERT((velocity - last).head<2>().norm() <= limits.max_acceleration * dt * (1.0 + 1e-9));
    RC_ASSERT(std::abs(velocity.z() - last.z()) <= limits.max_turn_acceleration * dt * (1.0 + 1e-9));
    last = velocity;
  }
}

TEST(VelocityLimiter, WhatIsNotFiniteStops)
{
  for (const double bad : { NOT_A_NUMBER, std::numeric_limits<double>::infinity() })
  {
    for (int axis = 0; axis < 3; ++axis)
    {
      BaseVelocityLimiter limiter{ VelocityLimits() };
      settled(limiter, { 0.2, 0.1, 0.3 });
      BaseVelocity wanted(0.1, 0.1, 0.1);
      wanted(axis) = bad;
      EXPECT_EQ(limiter.next(wanted, DT), BaseVelocity(BaseVelocity::Zero()));
      // It starts again from there.
      EXPECT_NEAR(limiter.next({ 0.2, 0.0, 0.0 }, DT).x(), 0.5 * DT, 1e-12);
    }
  }
}

TEST(VelocityLimiter, StopIsAtOnce)
{
  BaseVelocityLimiter limiter{ VelocityLimits() };
  settled(limiter, { 0.2, 0.1, 0.3 });
  limiter.stop();
  EXPECT_EQ(limiter.next(BaseVelocity::Zero(), DT), BaseVelocity(BaseVelocity::Zero()));
  EXPECT_NEAR(limiter.next({ 0.0, 0.2, 0.0 }, DT).y(), 0.5 * DT, 1e-12);
}

TEST(VelocityLimiter, NothingChangesInNoTime)
{
  BaseVelocityLimiter limiter{ VelocityLimits() };
  EXPECT_EQ(limiter.next({ 0.2, 0.0, 0.0 }, 0.0), BaseVelocity(BaseVelocity::Zero()));
  EXPECT_EQ(limiter.next({ 0.0, 0.0, 0.4 }, 0.0), BaseVelocity(BaseVelocity::Zero()));
  EXPECT_EQ(limiter.next({ 0.2, 0.0, 0.4 }, 0.0), BaseVelocity(BaseVelocity::Zero()));
}

TEST(TwistLimiter, LimitsSpeedAndTurnInSpace)
{
  TwistLimiter limiter{ VelocityLimits() };
  Twist wanted;
  wanted << 0.2, -0.2, 0.1, 0.8, 0.4, -0.8;  // 0.3 m/s and 1.2 rad/s: turns too fast by 3
  Twist velocity = limiter.next(wanted, DT);
  EXPECT_NEAR(velocity.tail<3>().norm(), 1.0 * DT, 1e-12);
  EXPECT_TRUE(velocity.normalized().isApprox(wanted.normalized(), 1e-9));
  for (int i = 0; i < 100; ++i)
  {
    velocity = limiter.next(wanted, DT);
  }
  EXPECT_TRUE(velocity.isApprox(wanted / 3.0, 1e-9));
}

TEST(VelocityLimits, NameAllFaultsAtOnce)
{
  EXPECT_TRUE(VelocityLimits().validate().empty());
  const std::vector<std::string> faults = VelocityLimits{ 0.0, -1.0, NOT_A_NUMBER, 0.0 }.validate();
  ASSERT_EQ(faults.size(), 4U);
  const std::vector<std::string> names{ "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration" };
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    EXPECT_EQ(faults[i].find(names[i] + " "), 0U) << faults[i];
  }
}

}  // namespace view_servo
