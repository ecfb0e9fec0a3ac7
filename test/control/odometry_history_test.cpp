// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/odometry_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace view_servo
{
namespace
{
void expectPose(const std::optional<PlanarPose>& pose, double x, double y, double yaw)
{
  ASSERT_TRUE(pose.has_value());
  EXPECT_NEAR(pose->x, x, 1e-9);
  EXPECT_NEAR(pose->y, y, 1e-9);
  EXPECT_NEAR(pose->yaw, yaw, 1e-9);
}

/** 0.1 m/s ahead and 0.2 rad/s to the left, at 10 Hz from 100 s to 102 s. */
OdometryHistory drive(double duration = 10.0)
{
  OdometryHistory history(duration);
  for (int i = 0; i <= 20; ++i)
  {
    history.add(100.0 + 0.1 * i, { 0.01 * i, -0.5, 0.02 * i });
  }
  return history;
}

}  // namespace

TEST(OdometryHistory, KnowsNothingAtFirst)
{
  const OdometryHistory history(10.0);
  EXPECT_FALSE(history.at(0.0).has_value());
  EXPECT_FALSE(history.newest().has_value());
}

TEST(OdometryHistory, GivesWhatWasThereAndInterpolates)
{
  const OdometryHistory history = drive();
  expectPose(history.at(100.0), 0.0, -0.5, 0.0);
  expectPose(history.at(100.7), 0.07, -0.5, 0.14);
  expectPose(history.at(100.73), 0.073, -0.5, 0.146);
  expectPose(history.at(102.0), 0.2, -0.5, 0.4);
  expectPose(history.newest(), 0.2, -0.5, 0.4);
}

TEST(OdometryHistory, IsNotMisledByABurst)
{
  OdometryHistory history = drive();
  history.add(102.001, { 0.204, -0.5, 0.4 });  // 4 mm within a millisecond
  const std::optional<PlanarPose> later = history.at(102.201);
  ASSERT_TRUE(later);
  EXPECT_NEAR(later->x, 0.22, 0.02);
}

TEST(OdometryHistory, GoesOnForALittleWhile)
{
  const OdometryHistory history = drive();
  expectPose(history.at(102.15), 0.215, -0.5, 0.43);
  EXPECT_FALSE(history.at(102.25).has_value());
  expectPose(history.at(102.25, 0.3), 0.225, -0.5, 0.45);
  EXPECT_FALSE(history.at(102.01, 0.0).has_value());
  EXPECT_FALSE(history.at(99.99).has_value());
}

TEST(OdometryHistory, InterpolatesTurnsTheShortWay)
{
  OdometryHistory history(10.0);
  history.add(1.0, { 0.0, 0.0, M_PI - 0.1 });
  history.add(2.0, { 0.0, 0.0, -M_PI + 0.3 });
  expectPose(history.at(1.25), 0.0, 0.0, M_PI);
  expectPose(history.at(1.75), 0.0, 0.0, -M_PI + 0.2);
}

TEST(OdometryHistory, OneEntryHolds)
{
  OdometryHistory history(10.0);
  history.add(5.0, { 1.0, 2.0, 0.3 });
  expectPose(history.at(5.0), 1.0, 2.0, 0.3);
  expectPose(history.at(5.1), 1.0, 2.0, 0.3);
  EXPECT_FALSE(history.at(4.9).has_value());
  EXPECT_FALSE(history.at(5.3).has_value());
}

TEST(OdometryHistory, ForgetsWhatIsOld)
{
  const OdometryHistory history = drive(1.0);
  EXPECT_FALSE(history.at(100.9).has_value());
  expectPose(history.at(101.05), 0.105, -0.5, 0.21);
  expectPose(history.at(102.0), 0.2, -0.5, 0.4);
}

TEST(OdometryHistory, SortsInWhatComesLate)
{
  OdometryHistory history(10.0);
  EXPECT_TRUE(history.add(100.0, { 0.0, 0.0, 0.0 }));
  EXPECT_TRUE(history.add(100.4, { 0.4, 0.0, 0.0 }));
  EXPECT_FALSE(history.add(100.2, { 0.1, 0.0, 0.0 }));
  expectPose(history.at(100.1), 0.05, 0.0, 0.0);
  expectPose(history.at(100.3), 0.25, 0.0, 0.0);
  expectPose(history.newest(), 0.4, 0.0, 0.0);
  EXPECT_FALSE(history.add(99.0, { 9.0, 9.0, 0.0 }));  // older than all
  EXPECT_FALSE(history.at(99.5).has_value());
  expectPose(history.at(100.1), 0.05, 0.0, 0.0);
}

TEST(OdometryHistory, TheSameStampTwiceIsNoHarm)
{
  OdometryHistory history = drive();
  history.add(102.0, { 9.0, 9.0, 0.0 });
  expectPose(history.at(102.0), 0.2, -0.5, 0.4);
  expectPose(history.at(101.0), 0.1, -0.5, 0.2);
  expectPose(history.at(102.1), 0.21, -0.5, 0.42);
}

}  // namespace view_servo
