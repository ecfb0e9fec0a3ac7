// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/clock_offset.h"

#include "view_servo/geometry/planar_pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace view_servo
{
namespace
{
/** A base that turns to and fro as a gain on a yaw error makes it: quickly first, then slower. */
double turned(double time)
{
  const double first = time < 2.0 ? 0.0 : 0.5 * (1.0 - std::exp(-(time - 2.0)));
  const double second = time < 8.0 ? 0.0 : -0.3 * (1.0 - std::exp(-(time - 8.0)));
  return first + second;
}

struct Drive
{
  double offset = 0.0;  // of odometry's stamps [s]
  double noise = 0.0;   // of the images' yaw [rad]
  double scale = 1.0;   // of odometry's turns
  double start = 0.0;   // yaw in odometry's frame [rad]

  template <typename Yaw>
  std::optional<double> estimate(const Yaw& yaw) const
  {
    std::mt19937 rng(1);
    std::normal_distribution<double> normal(0.0, noise > 0.0 ? noise : 1e-9);
    ClockOffset clocks;
    for (int tick = 0; tick < 600; ++tick)  // 12 s
    {
      const double time = 1000.0 + tick * 0.02;
      clocks.addOdometry(time + offset, wrapAngle(start + scale * yaw(time - 1000.0)));
      if (tick % 5 == 0)
      {
        clocks.addImage(time, wrapAngle(0.4 - yaw(time - 1000.0) + normal(rng)));
      }
    }
    return clocks.estimate();
  }
};

TEST(ClockOffset, IsFoundFromTurns)
{
  for (const double offset : { -0.4, -0.2, -0.1, -0.05, 0.0, 0.03, 0.05, 0.1, 0.2, 0.35, 0.5 })
  {
    Drive drive;
    drive.offset = offset;
    for (const double noise : { 0.0, 0.001 })
    {
      drive.noise = noise;
      const std::optional<double> found = drive.estimate(turned);
      ASSERT_TRUE(found) << offset;
      EXPECT_NEAR(*found, offset, 0.015) << "noise " << noise;
    }
  }
}

TEST(ClockOffset, IsFoundThoughOdometryTurnsTooMuchAndAcrossPi)
{
  Drive drive;
  drive.offset = 0.1;
  drive.start = 3.0;
  drive.noise = 0.001;
  for (const double scale : { 0.95, 1.05 })
  {
    drive.scale = scale;
    const std::optional<double> found = drive.estimate(turned);
    ASSERT_TRUE(found);
    EXPECT_NEAR(*found, 0.1, 0.02) << scale;
  }
}

TEST(ClockOffset, IsNotKnownWithoutTurnsThatTell)
{
  Drive drive;
  drive.offset = 0.1;
  drive.noise = 0.002;
  EXPECT_FALSE(drive.estimate([](double) { return 0.0; }));
  EXPECT_FALSE(drive.estimate([](double time) { return 0.05 * time; }));          // of one speed
  EXPECT_FALSE(drive.estimate([](double time) { return 1e-3 * turned(time); }));  // below the noise
  EXPECT_FALSE(ClockOffset().estimate());
}

TEST(ClockOffset, LeavesOutWhatComesInTheWrongOrder)
{
  ClockOffset clocks;
  for (int tick = 0; tick < 600; ++tick)
  {
    const double time = tick * 0.02;
    clocks.addOdometry(time, turned(time));
    clocks.addOdometry(time - 0.5, 7.0);
    if (tick % 5 == 0)
    {
      clocks.addImage(time, -turned(time));
      clocks.addImage(time - 1.0, 3.0);
    }
  }
  ASSERT_TRUE(clocks.estimate());
  EXPECT_NEAR(*clocks.estimate(), 0.0, 0.01);
}

}  // namespace
}  // namespace view_servo
