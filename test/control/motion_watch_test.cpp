// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/motion_watch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace view_servo
{
namespace
{
/** What the watch says within 10 s of a base that is told the one and does the other. */
std::string told(const BaseVelocity& told, const BaseVelocity& done, double lag = 0.0)
{
  constexpr double DT = 0.02;  // [s]
  MotionWatch watch;
  PlanarPose base;
  for (int i = 0; i < 500; ++i)
  {
    const double time = 100.0 + i * DT;
    watch.addCommand(time, told);
    if (i * DT >= lag)
    {
      base = compose(base, { DT * done.x(), DT * done.y(), DT * done.z() });
    }
    const std::string fault = watch.addOdometry(time, base);
    if (!fault.empty())
    {
      return fault;
    }
  }
  return "";
}

TEST(MotionWatch, AgreesWithABaseThatObeys)
{
  EXPECT_EQ(told({ 0.2, 0.1, 0.3 }, { 0.2, 0.1, 0.3 }, 0.3), "");
  EXPECT_EQ(told({ 0.2, 0.0, 0.0 }, { 0.25, 0.01, 0.02 }), "");  // odometry is not exact
  EXPECT_EQ(told({ 0.0, 0.0, 0.3 }, { 0.0, 0.0, 0.36 }), "");    // wheels that skid
  EXPECT_EQ(told({ 0.0, 0.0, 0.0 }, { 0.5, 0.0, 0.0 }), "");     // somebody else drives it
}

TEST(MotionWatch, SeesThatABaseDoesNotObey)
{
  for (const auto& [wanted, done] : { std::pair<BaseVelocity, BaseVelocity>{ { 0.1, 0.0, 0.0 }, { 0.0, 0.0, 0.0 } },
                                      { { 0.1, 0.0, 0.0 }, { -0.1, 0.0, 0.0 } },
                                      { { 0.0, 0.1, 0.0 }, { 0.0, 0.0, 0.0 } },   // it cannot slide
                                      { { 0.1, 0.0, 0.0 }, { 0.0, 0.1, 0.0 } },   // axes swapped
                                      { { 0.0, 0.0, 0.2 }, { 0.0, 0.0, -0.2 } },  // turns the other way
                                      { { 0.0, 0.0, 0.2 }, { 0.0, 0.0, 0.0 } } })
  {
    EXPECT_NE(told(wanted, done).find("the base does not do what it is told"), std::string::npos)
        << wanted.transpose() << " and " << done.transpose();
  }
  EXPECT_NE(told({ 0.1, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }).find("0.20 m ahead"), std::string::npos);
  EXPECT_EQ(told({ 0.1, 0.0, 0.0 }, { 0.0, 0.0, 0.0 }).find("slide"), std::string::npos);
  EXPECT_NE(told({ 0.1, 0.1, 0.0 }, { 0.1, 0.0, 0.0 }).find("~base: differential"), std::string::npos);
}

TEST(MotionWatch, BeginsAnewWhenTheBaseIsToldToStand)
{
  MotionWatch watch;
  for (int i = 0; i < 400; ++i)
  {
    const double time = i * 0.05;
    // A second of each: never 2 s of a command that nothing follows.
    watch.addCommand(time, i / 20 % 2 == 0 ? BaseVelocity(0.2, 0.0, 0.0) : BaseVelocity(0.0, 0.0, 0.0));
    EXPECT_EQ(watch.addOdometry(time, PlanarPose()), "");
  }
}

TEST(MotionWatch, SaysNothingOfATimeInWhichTheClockWasSet)
{
  MotionWatch watch;
  PlanarPose base;
  double clock = 0.0;
  for (int i = 0; i < 100; ++i)
  {
    clock += i == 50 ? 5.0 : 0.05;  // [s]
    base.x += 0.2 * 0.05;
    watch.addCommand(clock, BaseVelocity(0.2, 0.0, 0.0));
    EXPECT_EQ(watch.addOdometry(clock, base), "") << i;
  }
  // Afterwards it watches as before.
  std::string said;
  for (int i = 0; i < 60; ++i)
  {
    clock += 0.05;
    watch.addCommand(clock, BaseVelocity(0.2, 0.0, 0.0));
    said += watch.addOdometry(clock, base);
  }
  EXPECT_NE(said.find("the base does not do what it is told"), std::string::npos);
}

}  // namespace
}  // namespace view_servo
