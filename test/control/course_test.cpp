// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/course.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

namespace view_servo
{
namespace
{
PlanarPose arbitraryPose()
{
  return { *rc::gen::inRange(-300, 300) / 100.0, *rc::gen::inRange(-300, 300) / 100.0,
           *rc::gen::inRange(-314, 314) / 100.0 };
}

/** Follows a course exactly for some time. */
PlanarPose followed(const Course& course, PlanarPose base, double duration)
{
  constexpr double DT = 0.01;
  for (double time = 0.0; time < duration; time += DT)
  {
    const BaseVelocity velocity = DT * along(course, base);
    base = compose(base, { velocity.x(), velocity.y(), velocity.z() });
  }
  return base;
}

TEST(Course, StandsUnlessItIsKnownWhereTo)
{
  EXPECT_TRUE(along(Course(), { 1.0, 2.0, 3.0 }).isZero());
}

RC_GTEST_PROP(Course, LeadsToTheViewFromEverywhere, ())
{
  Course course;
  course.kind = Course::TO_VIEW;
  course.view = arbitraryPose();
  const PlanarPose start = arbitraryPose();
  const PlanarPose left = compose(inverse(followed(course, start, 20.0)), course.view);
  RC_ASSERT(left.distance() < 1e-3);
  RC_ASSERT(std::abs(left.yaw) < 1e-3);
}

TEST(Course, KeepsToItsSpeeds)
{
  Course course;
  course.kind = Course::TO_VIEW;
  course.view = { 2.0, 0.0, 0.0 };
  course.gain = 0.5;
  EXPECT_NEAR(along(course, PlanarPose()).x(), 1.0, 1e-12);
  course.max_speed = 0.1;
  EXPECT_NEAR(along(course, PlanarPose()).x(), 0.1, 1e-12);
  course.min_speed = 0.1;
  EXPECT_NEAR(along(course, { 1.99, 0.0, 0.0 }).x(), 0.1, 1e-12);
  course.max_speed = 0.02;
  EXPECT_NEAR(along(course, { 1.99, 0.0, 0.0 }).x(), 0.02, 1e-12) << "the limit counts";
}

RC_GTEST_PROP(Course, GoesAStepInItsDirectionWithoutTurning, ())
{
  Course course;
  course.kind = Course::STEP;
  course.start = arbitraryPose();
  course.heading = *rc::gen::inRange(-314, 314) / 100.0;
  course.length = 0.05;
  course.speed = 0.08;
  const PlanarPose done = compose(inverse(course.start), followed(course, course.start, 5.0));
  RC_ASSERT(std::abs(done.distance() - course.length) < 1e-3);
  RC_ASSERT(std::abs(wrapAngle(done.heading() - course.heading)) < 1e-6);
  RC_ASSERT(std::abs(done.yaw) < 1e-9);
  RC_ASSERT(along(course, compose(course.start, { 0.06, 0.0, 0.0 })).isZero());
}

}  // namespace
}  // namespace view_servo
