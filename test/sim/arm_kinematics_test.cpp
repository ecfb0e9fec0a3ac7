// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/arm_kinematics.h"

#include "support/shipped_files.h"
#include "support/text_file.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
using Joints = ArmKinematics::Joints;
using Twist = ArmKinematics::Twist;
using test::pumaUrdf;

constexpr double ACCURACY = 1e-6;  // [m, rad]

/** Well within all limits and away from singularities. */
const Joints FORWARD = (Joints() << 0.0, 0.9, -3.05, 0.0, 0.579204, 0.0).finished();

/** The URDF with the first joint kept within an angle of 0. */
std::string urdfWithNarrowFirstJoint(double angle)
{
  return test::edited(pumaUrdf(), "lower=\"-2.7925\" upper=\"2.7925\"",
                      "lower=\"-" + std::to_string(angle) + "\" upper=\"" + std::to_string(angle) + "\"");
}

Joints randomJoints(const ArmKinematics& arm, Rng& rng)
{
  Joints joints;
  for (int i = 0; i < ArmKinematics::JOINTS; ++i)
  {
    joints(i) = uniform(rng, arm.lower()(i), arm.upper()(i));
  }
  return joints;
}

void expectSamePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  EXPECT_LE((a.translation() - b.translation()).norm(), ACCURACY);
  EXPECT_LE(Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle(), 1.5 * ACCURACY);
}

void expectWithinLimits(const ArmKinematics& arm, const Joints& joints)
{
  EXPECT_TRUE((joints.array() >= arm.lower().array()).all() && (joints.array() <= arm.upper().array()).all())
      << joints.transpose();
}

}  // namespace

TEST(ArmKinematics, InverseReachesRandomPosesWithinTheLimits)
{
  const ArmKinematics arm(pumaUrdf(), {});
  Rng rng(1);
  for (int i = 0; i < 60; ++i)
  {
    const Eigen::Isometry3d pose = arm.pose(randomJoints(arm, rng));
    const std::optional<Joints> found = arm.inverse(pose, randomJoints(arm, rng));
    ASSERT_TRUE(found) << pose.matrix();
    expectSamePose(arm.pose(*found), pose);
    expectWithinLimits(arm, *found);
  }
}

TEST(ArmKinematics, InverseFindsTheSolutionNextToWhereItStarts)
{
  const ArmKinematics arm(pumaUrdf(), {});
  Rng rng(2);
  for (int i = 0; i < 20; ++i)
  {
    const Joints joints = FORWARD + 0.2 * Joints::NullaryExpr([&rng] { return uniform(rng, -1.0, 1.0); });
    const Joints near = joints + 0.1 * Joints::NullaryExpr([&rng] { return uniform(rng, -1.0, 1.0); });
    const std::optional<Joints> found = arm.inverse(arm.pose(joints), near);
    ASSERT_TRUE(found);
    EXPECT_LT((*found - joints).norm(), 1e-6);
  }
}

TEST(ArmKinematics, InverseTurnsTheLastJointTheShorterWay)
{
  // Its range is larger than a full turn, so that two angles give the same pose.
  const ArmKinematics arm(pumaUrdf(), {});
  Joints joints = FORWARD;
  joints(5) = 4.0;
  Joints near = FORWARD;
  for (const double start : { 3.5, -2.0 })
  {
    near(5) = start;
    const std::optional<Joints> found = arm.inverse(arm.pose(joints), near);
    ASSERT_TRUE(found);
    EXPECT_NEAR((*found)(5), start > 0.0 ? 4.0 : 4.0 - 2.0 * M_PI, 1e-6);
  }
}

TEST(ArmKinematics, InverseHasNoSolutionOutOfReach)
{
  const ArmKinematics arm(pumaUrdf(), {});
  const Eigen::Isometry3d reachable = arm.pose(FORWARD);
  ASSERT_TRUE(arm.inverse(reachable, Joints::Zero()));
  Rng rng(3);
  for (int i = 0; i < 5; ++i)
  {
    // Farther from the shoulder than the arm is long.
    Eigen::Isometry3d far = arm.pose(randomJoints(arm, rng));
    const Eigen::Vector3d shoulder(0.0, 0.0, 0.67);
    far.translation() = shoulder + 1.2 * (far.translation() - shoulder).normalized();
    EXPECT_FALSE(arm.inverse(far, FORWARD)) << far.matrix();
  }
  Eigen::Isometry3d in_the_trunk = reachable;
  in_the_trunk.translation() << 0.0, 0.0, 0.67;
  EXPECT_FALSE(arm.inverse(in_the_trunk, FORWARD));
}

TEST(ArmKinematics, InverseHasNoSolutionForWhatIsNoRotation)
{
  const ArmKinematics arm(pumaUrdf(), {});
  Eigen::Isometry3d mirrored = arm.pose(FORWARD);
  mirrored.linear().col(0) *= -1.0;
  EXPECT_FALSE(arm.inverse(mirrored, FORWARD));
  Eigen::Isometry3d scaled = arm.pose(FORWARD);
  scaled.linear() *= 1.01;
  EXPECT_FALSE(arm.inverse(scaled, FORWARD));
}

TEST(ArmKinematics, InverseKeepsTheLimits)
{
  // Nothing but the first joint turns the arm about the vertical, and it is kept within 10 degrees.
  const ArmKinematics free(pumaUrdf(), {});
  const ArmKinematics narrow(urdfWithNarrowFirstJoint(10.0 * DEGREE), {});
  EXPECT_NEAR(narrow.upper()(0), 10.0 * DEGREE, 1e-6);
  for (const double angle : { -60.0, -9.0, 0.0, 9.0, 11.0, 60.0 })
  {
    Joints joints = FORWARD;
    joints(0) = angle * DEGREE;
    const Eigen::Isometry3d pose = free.pose(joints);
    ASSERT_TRUE(free.inverse(pose, FORWARD));
    const std::optional<Joints> found = narrow.inverse(pose, FORWARD);
    EXPECT_EQ(found.has_value(), std::abs(angle) < 10.0) << angle;
    if (found)
    {
      expectWithinLimits(narrow, *found);
    }
  }
}

TEST(ArmKinematics, JointVelocitiesFollowATwist)
{
  const ArmKinematics arm(pumaUrdf(), {});
  Rng rng(4);
  for (int i = 0; i < 20; ++i)
  {
    const Joints joints = FORWARD + 0.2 * Joints::NullaryExpr([&rng] { return uniform(rng, -1.0, 1.0); });
    const Twist twist = Twist::NullaryExpr([&rng] { return uniform(rng, -0.1, 0.1); });
    const ArmKinematics::Following following = arm.follow(joints, twist);
    ASSERT_GT(following.manipulability, ArmKinematicsParams().min_manipulability);
    EXPECT_LT((arm.jacobian(joints) * following.velocities - twist).norm(), 1e-9);
    // The pose after a short time is the one that the twist leads to.
    constexpr double DT = 1e-5;
    const Eigen::Isometry3d motion = arm.pose(joints - 0.5 * DT * following.velocities).inverse() *
                                     arm.pose(joints + 0.5 * DT * following.velocities);
    EXPECT_LT((motion.translation() / DT - twist.head<3>()).norm(), 1e-5);
    const Eigen::AngleAxisd turn(motion.linear());
    EXPECT_LT((turn.angle() / DT * turn.axis() - twist.tail<3>()).norm(), 1e-5);
  }
}

TEST(ArmKinematics, VelocityLimitsSlowAllJointsDownAlike)
{
  const ArmKinematics arm(pumaUrdf(), {});
  Joints velocities = Joints::Constant(0.1);
  EXPECT_EQ(arm.withinVelocityLimits(velocities).factor, 1.0);
  velocities(2) = -4.26;  // its limit is 2.13 rad/s
  const ArmKinematics::Slowdown slowdown = arm.withinVelocityLimits(velocities);
  EXPECT_NEAR(slowdown.factor, 0.5, 1e-12);
  EXPECT_EQ(slowdown.joint, 2);
}

TEST(ArmKinematics, LeavesRoomToStopBeforeTheEnds)
{
  constexpr double DT = 0.002;          // [s]
  constexpr double ACCELERATION = 2.0;  // [rad/s²]
  const ArmKinematics arm(pumaUrdf(), {});
  Joints velocities = Joints::Zero();
  velocities(1) = -0.5;
  EXPECT_EQ(arm.beforeEnds(FORWARD, velocities, DT, ACCELERATION).factor, 1.0);
  Joints joints = FORWARD;
  joints(1) = arm.lower()(1) + 0.01;
  const ArmKinematics::Slowdown slowdown = arm.beforeEnds(joints, velocities, DT, ACCELERATION);
  EXPECT_EQ(slowdown.joint, 1);
  EXPECT_LT(slowdown.factor, 1.0);
  // On its own speed for DT; then it brakes, with the fastest joint's full speed as the measure of time.
  const double speed = slowdown.factor * 0.5;
  EXPECT_NEAR(speed * DT + speed * speed / (2.0 * ACCELERATION), 0.01, 1e-12);
}

TEST(ArmKinematics, AcceleratesNoJointByMoreThanTheLimit)
{
  constexpr double DT = 0.002;          // [s]
  constexpr double ACCELERATION = 2.0;  // [rad/s²]
  const ArmKinematics arm(pumaUrdf(), {});
  Rng rng(5);
  for (int i = 0; i < 100; ++i)
  {
    const Joints velocities = Joints::NullaryExpr([&rng] { return uniform(rng, -0.05, 0.05); });
    const Joints wanted = Joints::NullaryExpr([&rng] { return uniform(rng, -0.05, 0.05); });
    const Joints next = arm.accelerate(FORWARD, velocities, wanted, DT, ACCELERATION);
    EXPECT_LE((next - velocities).cwiseAbs().maxCoeff(), ACCELERATION * DT * (1.0 + 1e-9));
  }
  const Joints slow = Joints::Constant(0.001);
  EXPECT_EQ(arm.accelerate(FORWARD, Joints::Zero(), slow, DT, ACCELERATION), slow);
}

TEST(ArmKinematics, NamesFaultsOfItsParameters)
{
  ArmKinematicsParams params;
  params.base_link = "";
  params.camera_frame = "";
  params.damping = -1.0;
  params.min_manipulability = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 4U);
  EXPECT_THROW(ArmKinematics(pumaUrdf(), params), std::invalid_argument);
  params = {};
  params.camera_frame = "nowhere";
  EXPECT_THROW(ArmKinematics(pumaUrdf(), params), std::invalid_argument);
}

}  // namespace view_servo::sim
