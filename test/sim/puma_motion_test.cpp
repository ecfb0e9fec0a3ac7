// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// How the arm moves when it is told twists.
#include "puma_test.h"

#include <gtest/gtest.h>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
TEST(Puma, CameraMovesAsCommanded)
{
  Rng rng(2);
  for (int i = 0; i < 20; ++i)
  {
    Puma puma = makePuma();
    puma.setJoints(usualJoints(rng));
    const Twist twist = randomTwist(rng, 0.04, 0.1);
    ASSERT_TRUE(puma.command(twist));
    accelerate(puma);
    const Eigen::Isometry3d start = puma.cameraPose();
    Eigen::Isometry3d expected = start;
    for (int k = 0; k < 500; ++k)
    {
      const Eigen::Isometry3d before = puma.cameraPose();
      puma.step(DT);
      ASSERT_EQ(puma.state(), State::MOVING) << puma.message();
      ASSERT_LT((twistBetween(before, puma.cameraPose(), DT) - twist).cwiseAbs().maxCoeff(), 2e-6);
      expected = moved(expected, twist, DT);
    }
    EXPECT_LT(distance(puma.cameraPose(), expected), 1e-6);
    EXPECT_LT(angle(puma.cameraPose(), expected), 1e-6);
    EXPECT_GT(distance(puma.cameraPose(), start) + angle(puma.cameraPose(), start), 0.01);
  }
}

TEST(Puma, CameraMovesAlongEachAxisAsCommanded)
{
  for (int axis = 0; axis < 6; ++axis)
  {
    Puma puma = makePuma();
    puma.setJoints(FORWARD);
    const Eigen::Isometry3d start = puma.cameraPose();
    puma.command(0.05 * Twist::Unit(axis));
    accelerate(puma);
    // Also while it gathers speed the direction is the one commanded.
    const Twist way = twistBetween(start, puma.cameraPose(), 0.5);
    EXPECT_NEAR(way(axis), 0.05, 0.005);
    EXPECT_LT((way - way(axis) * Twist::Unit(axis)).norm(), 1e-4);
  }
}

TEST(Puma, TheWayDoesNotDependOnTheLengthOfSteps)
{
  Puma fine = makePuma();
  Puma coarse = makePuma();
  const Twist twist = (Twist() << 0.05, -0.03, 0.04, 0.1, -0.1, 0.2).finished();
  for (Puma* puma : { &fine, &coarse })
  {
    puma->setJoints(FORWARD);
    puma->command(twist);
  }
  for (int i = 0; i < 1000; ++i)
  {
    fine.step(0.001);
  }
  for (int i = 0; i < 10; ++i)
  {
    coarse.step(0.1);
  }
  // Velocities change at the beginning of a part: its length delays the start by half as much.
  EXPECT_LT((fine.joints() - coarse.joints()).norm(), 1e-3);
}

TEST(Puma, StopsWithinTheAccelerationLimit)
{
  Puma puma = makePuma();
  puma.setJoints(FORWARD);
  puma.command((Twist() << 0.0, 0.0, 0.2, 0.0, 0.0, 0.0).finished());
  accelerate(puma);
  const double speed = puma.velocities().cwiseAbs().maxCoeff();
  puma.command(Twist::Zero());
  const int needed = static_cast<int>(std::ceil(speed / (PumaParams().max_joint_acceleration * DT)));
  ASSERT_GT(needed, 20);
  for (int i = 0; i < needed - 2; ++i)
  {
    puma.step(DT);
    ASSERT_EQ(puma.state(), State::MOVING);
  }
  for (int i = 0; i < 4; ++i)
  {
    puma.step(DT);
  }
  EXPECT_EQ(puma.state(), State::STILL);
  EXPECT_EQ(puma.velocities(), Joints::Zero());
}

TEST(Puma, NeverExceedsAnyLimit)
{
  Rng rng(3);
  std::array<int, 4> times{};
  std::array<int, Puma::JOINTS> ends{};
  for (int run = 0; run < 10; ++run)
  {
    PumaParams params;
    params.max_joint_acceleration = uniform(rng, 0.5, 20.0);
    params.damping = run % 3 == 0 ? 0.0 : uniform(rng, 0.0, 0.2);
    Puma puma = makePuma(params);
    puma.setJoints(randomJoints(rng));
    double left = 0.0;  // until the next command [s]
    for (int i = 0; i < 10000; ++i)
    {
      if (left <= 0.0)
      {
        left = uniform(rng, 0.0, 1.0) < 0.2 ? 0.01 : uniform(rng, 0.0, 2.0);
        puma.command(uniform(rng, 0.0, 1.0) < 0.1 ? Twist::Zero() : randomTwist(rng, 0.5, 1.5));
      }
      const double dt = uniform(rng, 0.0, 1.0) < 0.5 ? DT : uniform(rng, 1e-5, 0.002);
      const Joints velocities = puma.velocities();
      const Joints joints = puma.joints();
      puma.step(dt);
      left -= dt;
      ASSERT_TRUE((puma.joints().array() >= LOWER.array()).all() && (puma.joints().array() <= UPPER.array()).all());
      ASSERT_TRUE((puma.velocities().array().abs() <= (1.0 + 1e-12) * MAX_VELOCITY.array()).all())
          << puma.velocities().transpose();
      ASSERT_LE((puma.velocities() - velocities).cwiseAbs().maxCoeff(),
                params.max_joint_acceleration * dt * (1.0 + 1e-9) + 1e-15);
      ASSERT_LT((joints + dt * puma.velocities() - puma.joints()).norm(), 1e-12);
      ++times[static_cast<std::size_t>(puma.state())];
      for (std::size_t k = 0; k < ends.size(); ++k)
      {
        ends[k] += puma.state() == State::AT_LIMIT && puma.message().find(puma.jointNames()[k]) == 0 ? 1 : 0;
      }
    }
  }
  // The run has been everywhere.
  EXPECT_GT(*std::min_element(times.begin(), times.end()), 100);
  EXPECT_GT(*std::min_element(ends.begin(), ends.end()), 100);
}

TEST(Puma, SlowsDownAtAVelocityLimitInTheSameDirection)
{
  Puma puma = makePuma();
  puma.setJoints(FORWARD);
  const Twist twist = (Twist() << 1.0, 2.0, -1.5, 1.0, 0.5, 6.0).finished();
  puma.command(twist);
  for (int i = 0; i < 30; ++i)
  {
    const Eigen::Isometry3d before = puma.cameraPose();
    puma.step(DT);
    const Twist actual = twistBetween(before, puma.cameraPose(), DT);
    ASSERT_GT(actual.dot(twist) / (actual.norm() * twist.norm()), 1.0 - 1e-5);
    ASSERT_LT(actual.norm(), 0.5 * twist.norm());
  }
  EXPECT_EQ(puma.state(), State::MOVING);
  expectNamed(puma.message(), "velocity limit of joint");
}

TEST(Puma, StopsAtEveryEndNamesItAndLeavesItAgain)
{
  for (int joint = 0; joint < Puma::JOINTS; ++joint)
  {
    for (const bool up : { false, true })
    {
      Puma puma = makePuma();
      Joints start = DOWN;
      start(joint) = up ? UPPER(joint) - 0.05 : LOWER(joint) + 0.05;
      puma.setJoints(start);
      // The twist of this joint's motion alone.
      const Joints step = (up ? 1e-6 : -1e-6) * Joints::Unit(joint);
      const Twist twist = 0.2 * twistBetween(puma.nominalCameraPose(start), puma.nominalCameraPose(start + step), 1e-6);
      puma.command(twist);
      for (int i = 0; i < 2000; ++i)
      {
        puma.step(DT);
      }
      const std::string name = puma.jointNames()[static_cast<std::size_t>(joint)];
      ASSERT_EQ(puma.state(), State::AT_LIMIT) << name;
      expectNamed(puma.message(), name);
      expectNamed(puma.message(), up ? "upper" : "lower");
      EXPECT_LT(puma.velocities().cwiseAbs().maxCoeff(), 1e-6);

      const Joints end = puma.joints();
      puma.command(-twist);
      accelerate(puma);
      EXPECT_NE(puma.state(), State::AT_LIMIT) << puma.message();
      EXPECT_GT(std::abs(puma.joints()(joint) - end(joint)), 0.01);
    }
  }
}

TEST(Puma, CameraStaysOnItsPathUntilTheEnd)
{
  Rng rng(5);
  int stops = 0;
  for (int run = 0; run < 20; ++run)
  {
    Puma puma = makePuma();
    puma.setJoints(usualJoints(rng));
    const Twist twist = randomTwist(rng, 0.05, 0.2);
    puma.command(twist);
    for (int i = 0; i < 8000 && (i % 20 != 0 || manipulability(puma, puma.joints()) > 0.1); ++i)
    {
      const Eigen::Isometry3d before = puma.cameraPose();
      puma.step(DT);
      const Twist actual = twistBetween(before, puma.cameraPose(), DT);
      const Twist aside = actual - actual.dot(twist) / twist.squaredNorm() * twist;
      ASSERT_LT(aside.norm(), 0.003 * twist.norm()) << puma.message();
    }
    stops += puma.state() == State::AT_LIMIT ? 1 : 0;
  }
  EXPECT_GE(stops, 5);
}

TEST(Puma, AtAnEndItFollowsTwistsThatDoNotNeedThatJoint)
{
  Puma puma = makePuma();
  Joints start = DOWN;
  start(0) = UPPER(0);
  puma.setJoints(start);
  // Up, in the arm's vertical plane: joints 2, 3 and 5 are enough.
  puma.command((Twist() << 0.0, 0.0, -0.05, 0.0, 0.0, 0.0).finished());
  accelerate(puma);
  EXPECT_EQ(puma.state(), State::MOVING) << puma.message();
  EXPECT_GT(puma.cameraPose().translation().z() - puma.nominalCameraPose(start).translation().z(), 0.02);
}

TEST(Puma, SlowsDownAndReportsWhereItIsSingular)
{
  const Joints wrist = (Joints() << 0.3, 1.0, -2.8, 0.2, 0.0, 0.1).finished();
  const Joints elbow = (Joints() << 0.3, 0.5, -M_PI_2 + std::atan2(0.0203, 0.4318), 0.2, 0.8, 0.1).finished();
  for (const Joints& singular : { wrist, elbow })
  {
    Puma puma = makePuma();
    puma.setJoints(singular);
    ASSERT_LT(manipulability(puma, singular), 1e-3);
    Rng rng(6);
    puma.command(randomTwist(rng, 0.1, 0.2));
    for (int i = 0; i < 5; ++i)
    {
      puma.step(DT);
      EXPECT_EQ(puma.state(), State::NEAR_SINGULARITY);
      expectNamed(puma.message(), "singular");
    }
    puma.command(Twist::Zero());
    accelerate(puma);
    EXPECT_EQ(puma.state(), State::STILL);
    EXPECT_EQ(puma.message(), "");
  }
}

TEST(Puma, SlowsDownOnTheWayIntoTheStretchedArm)
{
  Puma puma = makePuma();
  const Joints start = (Joints() << 0.0, 0.6, -2.0, 0.0, 0.5, 0.0).finished();
  puma.setJoints(start);
  // Along the line from the shoulder to the camera, of which it can reach only some.
  const Eigen::Isometry3d pose = puma.cameraPose();
  const Eigen::Vector3d out = (pose.translation() - Eigen::Vector3d(0.0, -0.15005, 0.67)).normalized();
  Twist twist = Twist::Zero();
  twist.head<3>() = pose.linear().transpose() * (0.1 * out);
  puma.command(twist);
  accelerate(puma);
  EXPECT_EQ(puma.state(), State::MOVING);
  double fastest = 0.0;
  for (int i = 0; i < 10000; ++i)
  {
    puma.step(DT);
    fastest = std::max(fastest, puma.velocities().cwiseAbs().maxCoeff());
  }
  EXPECT_EQ(puma.state(), State::NEAR_SINGULARITY);
  EXPECT_LT(fastest, 1.29 + 1e-9);
  const Eigen::Isometry3d before = puma.cameraPose();
  puma.step(DT);
  EXPECT_LT(distance(before, puma.cameraPose()) / DT, 0.05);
}

TEST(Puma, IsDampedNearSingularitiesAsTheParametersSay)
{
  PumaParams params;
  const Joints joints = (Joints() << 0.3, 1.2, -3.1, 0.2, 0.02, 0.1).finished();
  Puma puma = makePuma(params);
  puma.setJoints(joints);
  const auto jacobian = decomposedJacobian(puma, joints);
  const double smallest = jacobian.singularValues()(5);
  ASSERT_LT(smallest, 0.5 * params.min_manipulability);
  ASSERT_GT(smallest, 0.1 * params.min_manipulability);
  const Twist twist = 1e-4 * jacobian.matrixU().col(5);
  puma.command(twist);
  const Eigen::Isometry3d before = puma.cameraPose();
  puma.step(DT);
  const double damping = params.damping * (1.0 - std::pow(smallest / params.min_manipulability, 2));
  const double part = smallest * smallest / (smallest * smallest + damping * damping);
  EXPECT_NEAR(twistBetween(before, puma.cameraPose(), DT).dot(twist) / twist.squaredNorm(), part, 0.01 * part);
}

TEST(Puma, IsNotDampedAwayFromSingularities)
{
  PumaParams params;
  params.damping = 0.0;
  Puma undamped = makePuma(params);
  Puma damped = makePuma();
  for (Puma* puma : { &undamped, &damped })
  {
    puma->setJoints(DOWN);
    puma->command((Twist() << 0.05, -0.03, 0.04, 0.1, -0.1, 0.2).finished());
    accelerate(*puma);
  }
  EXPECT_EQ(undamped.joints(), damped.joints());
}

TEST(Puma, RefusesTwistsThatAreNotFiniteAndKeepsTheFormer)
{
  Puma puma = makePuma();
  Puma undisturbed = makePuma();
  const Twist twist = 0.05 * Twist::Unit(2);
  for (Puma* each : { &puma, &undisturbed })
  {
    each->setJoints(FORWARD);
    each->command(twist);
  }
  for (int i = 0; i < 6; ++i)
  {
    for (const double bad : { std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                              -std::numeric_limits<double>::infinity() })
    {
      Twist faulty = twist;
      faulty(i) = bad;
      EXPECT_FALSE(puma.command(faulty));
      puma.step(DT);
      undisturbed.step(DT);
    }
  }
  EXPECT_EQ(puma.joints(), undisturbed.joints());
}

TEST(Puma, SurvivesEnormousAndTinyTwists)
{
  for (const double size : { std::numeric_limits<double>::max(), 1e100, 1e-100, 1e-310 })
  {
    for (const Joints& joints : { FORWARD, Joints(Joints::Zero()) })
    {
      Puma puma = makePuma();
      puma.setJoints(joints);
      EXPECT_TRUE(puma.command(Twist::Constant(size)));
      accelerate(puma);
      EXPECT_TRUE(puma.joints().allFinite() && puma.velocities().allFinite());
    }
  }
}

TEST(Puma, RefusesTimesThatItCannotMoveOn)
{
  Puma puma = makePuma();
  for (const double dt :
       { 0.0, -0.001, 61.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity() })
  {
    EXPECT_THROW(puma.step(dt), std::invalid_argument) << dt;
  }
}

}  // namespace
}  // namespace view_servo::sim
