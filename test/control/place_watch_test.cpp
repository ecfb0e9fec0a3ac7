// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/place_watch.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>

namespace view_servo
{
namespace
{
constexpr PlaceWatchLimits LIMITS{ 0.015, 0.02, 0.04, 0.03, 0.2, 0.15 };
const Eigen::Isometry3d HERE = Eigen::Isometry3d::Identity();

Eigen::Isometry3d at(double x, double y, double yaw)
{
  Eigen::Isometry3d pose(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  pose.translation() << x, y, 0.0;
  return pose;
}

/** Drives from x = -0.5 m to a view at the origin in steps, and sees it rightly but for a factor of all distances. */
void approach(PlaceWatch& watch, double until, double factor, double step = 0.005)
{
  for (double x = -0.5; x <= until; x += step)
  {
    Eigen::Isometry3d view = at(x, 0.0, 0.3 * x).inverse();
    view.translation() *= factor;
    watch.add(at(x, 0.0, 0.3 * x), view, 1.0 / factor);
  }
}

TEST(PlaceWatch, TrustsAViewThatIsSeenWhereTheCameraHasBeenAllTheTime)
{
  PlaceWatch watch(LIMITS);
  EXPECT_TRUE(watch.trusted());
  for (int i = 0; i < 20; ++i)
  {
    watch.add(at(3.0, 1.0, 0.2), at(0.001, 0.0, 0.001), 1.0);
    EXPECT_TRUE(watch.trusted());
    EXPECT_FALSE(watch.contradicted());
  }
}

TEST(PlaceWatch, TrustsAViewThatMovesAsTheCameraDoesWhateverTheUnit)
{
  for (const double factor : { 0.3, 1.0, 3.0 })
  {
    PlaceWatch watch(LIMITS);
    approach(watch, 0.0, factor);
    EXPECT_TRUE(watch.trusted()) << factor;
    EXPECT_FALSE(watch.contradicted()) << factor;
  }
}

TEST(PlaceWatch, TrustsWhenTheUnitIsNotKnown)
{
  PlaceWatch watch(LIMITS);
  for (double x = -0.06; x <= 0.0; x += 0.004)
  {
    watch.add(at(x, 0.0, 0.0), at(-2.5 * x, 0.0, 0.0), 1.0);  // all is taken for 2.5 times as far as it is
  }
  EXPECT_TRUE(watch.trusted());
  EXPECT_FALSE(watch.contradicted());
}

TEST(PlaceWatch, DoesNotTrustAPictureHeldBeforeACameraThatStands)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.1, 1.0);
  ASSERT_TRUE(watch.trusted());
  for (int i = 0; i < 50; ++i)
  {
    watch.add(at(-0.1, 0.0, -0.03), HERE, 1.0);
    EXPECT_FALSE(watch.trusted());
  }
}

TEST(PlaceWatch, DoesNotTrustAPictureHeldBeforeACameraThatStops)
{
  for (const double begin : { -0.4, -0.1, -0.05, -0.03 })
  {
    PlaceWatch watch(LIMITS);
    approach(watch, begin, 1.0, 0.002);
    double x = begin;
    for (double speed = 0.02; speed > 0.0; speed -= 0.002)
    {
      x += speed;
      watch.add(at(x, 0.0, 0.3 * x), HERE, 1.0);
    }
    EXPECT_FALSE(watch.trusted()) << begin;
  }
}

TEST(PlaceWatch, DoesNotTrustAPictureThatAppearsWhileTheCameraBrakesUnseen)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.1, 1.0);
  ASSERT_TRUE(watch.trusted());
  watch.interrupt();
  for (int i = 0; i < 20; ++i)
  {
    watch.add(at(-0.04 + 1e-3 * i, 0.0, -0.012), HERE, 1.0);
    EXPECT_FALSE(watch.trusted());
  }
}

TEST(PlaceWatch, TrustsTheViewThatIsSeenAgainAfterTheCameraHasMovedUnseen)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.1, 1.0);
  watch.interrupt();
  watch.add(at(-0.04, 0.0, -0.012), at(-0.04, 0.0, -0.012).inverse(), 1.0);
  EXPECT_TRUE(watch.trusted());
}

TEST(PlaceWatch, TrustsAgainAfterTheCameraHasMovedBeforeTheView)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.2, 1.0);
  watch.add(at(-0.2, 0.0, -0.06), HERE, 1.0);
  ASSERT_FALSE(watch.trusted());
  watch.add(at(-0.2, 0.0, -0.06), at(-0.2, 0.0, -0.06).inverse(), 1.0);  // the picture is gone
  EXPECT_FALSE(watch.trusted());
  watch.add(at(-0.2, 0.0, -0.06), at(-0.2, 0.0, -0.06).inverse(), 1.0);
  watch.add(at(-0.15, 0.0, -0.05), at(-0.15, 0.0, -0.05).inverse(), 1.0);
  EXPECT_TRUE(watch.trusted());
}

/** A tracker that is turned to another picture may be halfway there in the first image. */
TEST(PlaceWatch, DoesNotTakeItselfForMovedByWhatIsNotYetThere)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.2, 1.0);
  watch.add(at(-0.16, 0.0, -0.05), at(0.01, 0.0, 0.0), 1.0);
  watch.add(at(-0.13, 0.0, -0.04), HERE, 1.0);
  EXPECT_FALSE(watch.trusted());
  watch.add(at(-0.11, 0.0, -0.04), HERE, 1.0);
  EXPECT_FALSE(watch.trusted());
}

TEST(PlaceWatch, IsContradictedByAPictureThatStaysOrGoesTheOtherWay)
{
  for (const double part : { 0.0, -1.0 })
  {
    PlaceWatch ahead(LIMITS);
    PlaceWatch turning(LIMITS);
    for (double moved = 0.0; moved < 0.3; moved += 0.01)
    {
      EXPECT_TRUE(moved < 0.215 || ahead.contradicted()) << part << ", " << moved;
      ahead.add(at(moved, 0.0, 0.0), at(1.0 - part * moved, 0.0, 0.0), 1.0);
      turning.add(at(0.0, 0.0, moved), at(0.0, 0.0, -part * moved), 1.0);
    }
    EXPECT_TRUE(ahead.contradicted());
    EXPECT_TRUE(turning.contradicted());
    EXPECT_FALSE(ahead.trusted());
    EXPECT_FALSE(turning.trusted());
  }
}

TEST(PlaceWatch, IsNotContradictedByErrorsWhileTheCameraTurnsToAndFro)
{
  PlaceWatch watch(LIMITS);
  const auto see = [&](double yaw, double error) {
    watch.add(at(0.0, 0.0, yaw), (at(0.0, 0.0, yaw + error)).inverse() * at(1.0, 0.0, 0.0), 1.0);
  };
  for (int i = 0; i < 200; ++i)
  {
    see(0.03 * std::sin(0.3 * i), 0.0);  // far more than the limit in all, to and fro
  }
  for (double moved = 0.0; moved < 0.08; moved += 0.01)
  {
    see(moved, -moved);
    EXPECT_FALSE(watch.contradicted()) << moved;
  }
}

TEST(PlaceWatch, IsContradictedByAPictureThatIsTurnedRoundHoweverItTurns)
{
  const Eigen::Isometry3d round(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
  PlaceWatch watch(LIMITS);
  for (double moved = 0.0; moved < 0.4; moved += 0.01)
  {
    const Eigen::Isometry3d camera = at(moved, 0.0, 2.0 * moved);
    watch.add(camera, (camera * round).inverse() * at(1.0, 0.2, 0.0), 1.0);
  }
  EXPECT_TRUE(watch.contradicted());
}

TEST(PlaceWatch, ForgetsTheContradictionWhenTheViewIsSeenElsewhere)
{
  PlaceWatch watch(LIMITS);
  for (double x = 0.0; x < 0.3; x += 0.01)
  {
    watch.add(at(x, 0.0, 0.0), at(1.0, 0.0, 0.0), 1.0);
  }
  ASSERT_TRUE(watch.contradicted());
  watch.add(at(0.3, 0.0, 0.0), at(1.05, 0.0, 0.0), 1.0);
  EXPECT_TRUE(watch.contradicted()) << "what is seen has hardly changed";
  watch.add(at(0.3, 0.0, 0.0), at(0.7, 0.0, 0.0), 1.0);
  EXPECT_FALSE(watch.contradicted());
}

TEST(PlaceWatch, GoesOnAfterARestartWhereTheViewWasBelieved)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.005, 1.0);
  ASSERT_TRUE(watch.trusted());
  watch.restart(at(0.002, 0.0, 0.0));
  watch.add(at(-0.005, 0.0, 0.0), at(0.009, 0.0, 0.0), 0.5);
  EXPECT_TRUE(watch.trusted());
}

TEST(PlaceWatch, IsNotSureAfterARestartElsewhere)
{
  PlaceWatch watch(LIMITS);
  approach(watch, -0.1, 1.0);
  watch.restart(at(0.002, 0.0, 0.0));
  watch.add(at(-0.1, 0.0, 0.0), at(5.0, 0.0, 0.0), 1.0);
  EXPECT_FALSE(watch.trusted());
  watch.add(at(-0.1, 0.0, 0.0), at(5.0, 0.0, 0.0), 1.0);
  watch.add(at(-0.05, 0.0, 0.0), at(4.95, 0.0, 0.0), 1.0);
  EXPECT_TRUE(watch.trusted());
}

}  // namespace
}  // namespace view_servo
