// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the arm is, and what it takes.
#include "puma_test.h"

#include "support/text_file.h"

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
using test::edited;
using test::pumaUrdf;

TEST(Puma, PosesAreThoseOfItsDenavitHartenbergTable)
{
  const Puma puma = makePuma();
  Rng rng(1);
  for (int i = 0; i < 1000; ++i)
  {
    const Joints joints = randomJoints(rng);
    EXPECT_TRUE(puma.nominalCameraPose(joints).isApprox(denavitHartenberg(joints), 1e-12)) << joints.transpose();
  }
}

TEST(Puma, StartsAtRest)
{
  const Puma puma = makePuma();
  EXPECT_EQ(puma.jointNames(),
            (std::vector<std::string>{ "joint1", "joint2", "joint3", "joint4", "joint5", "joint6" }));
  EXPECT_EQ(puma.joints(), Joints::Zero());
  EXPECT_EQ(puma.velocities(), Joints::Zero());
  EXPECT_EQ(puma.state(), State::STILL);
  EXPECT_EQ(puma.message(), "");
}

TEST(Puma, LooksWhereTheUrdfSays)
{
  const Puma puma = makePuma();
  const Eigen::Isometry3d forward = puma.nominalCameraPose(FORWARD);
  EXPECT_LT((forward.linear().col(2) - Eigen::Vector3d::UnitX()).norm(), 1e-6);
  EXPECT_LT((forward.linear().col(1) + Eigen::Vector3d::UnitZ()).norm(), 1e-6);
  EXPECT_LT((forward.translation() - Eigen::Vector3d(0.735, -0.150, 0.800)).norm(), 1e-3);
  const Eigen::Isometry3d down = puma.nominalCameraPose(DOWN);
  EXPECT_LT((down.linear().col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-6);
  EXPECT_LT((down.linear().col(1) + Eigen::Vector3d::UnitX()).norm(), 1e-6);
  EXPECT_LT((down.translation() - Eigen::Vector3d(0.604, -0.150, 0.797)).norm(), 1e-3);
  EXPECT_GT(manipulability(puma, FORWARD), 5.0 * PumaParams().min_manipulability);
  EXPECT_GT(manipulability(puma, DOWN), 5.0 * PumaParams().min_manipulability);
}

TEST(Puma, ReachesCameraPosesThatJointsGave)
{
  Rng rng(7);
  PumaParams params;
  params.hand_eye_translation_error = 0.02;
  params.hand_eye_rotation_error = 0.05;
  Puma source = makePuma(params);
  Puma puma = makePuma(params);
  for (int i = 0; i < 40; ++i)
  {
    source.setJoints(randomJoints(rng));
    puma.setJoints(randomJoints(rng));
    puma.command(randomTwist(rng, 0.1, 0.1));
    puma.step(DT);
    ASSERT_TRUE(puma.setCameraPose(source.cameraPose())) << source.joints().transpose();
    EXPECT_LT(distance(puma.cameraPose(), source.cameraPose()), 1e-6);
    EXPECT_LT(angle(puma.cameraPose(), source.cameraPose()), 1e-6);
    EXPECT_TRUE((puma.joints().array() >= LOWER.array()).all() && (puma.joints().array() <= UPPER.array()).all());
    EXPECT_EQ(puma.velocities(), Joints::Zero());
    EXPECT_EQ(puma.state(), State::STILL);
    // There was a twist to follow; there is none now.
    const Joints there = puma.joints();
    puma.step(DT);
    EXPECT_EQ(puma.joints(), there);
  }
}

TEST(Puma, TakesTheNearestSolution)
{
  Rng rng(8);
  Puma puma = makePuma();
  for (int i = 0; i < 10; ++i)
  {
    const Joints goal = usualJoints(rng);
    Joints start = goal;
    for (int k = 0; k < Puma::JOINTS; ++k)
    {
      start(k) += uniform(rng, -0.1, 0.1);
    }
    puma.setJoints(start);
    ASSERT_TRUE(puma.setCameraPose(puma.nominalCameraPose(goal)));
    EXPECT_LT((puma.joints() - goal).norm(), 1e-6);
  }
  // Joint 6 turns further than once.
  Joints goal = DOWN;
  goal(5) = 4.0;
  Joints start = DOWN;
  start(5) = 3.5;
  puma.setJoints(start);
  ASSERT_TRUE(puma.setCameraPose(puma.nominalCameraPose(goal)));
  EXPECT_LT((puma.joints() - goal).norm(), 1e-6);
}

TEST(Puma, StaysWhereThePoseIsItsOwn)
{
  Rng rng(9);
  Puma puma = makePuma();
  for (int i = 0; i < 10; ++i)
  {
    Joints joints = randomJoints(rng);
    joints(i % Puma::JOINTS) = i % 2 == 0 ? LOWER(i % Puma::JOINTS) : UPPER(i % Puma::JOINTS);
    puma.setJoints(joints);
    ASSERT_TRUE(puma.setCameraPose(puma.cameraPose()));
    EXPECT_LT((puma.joints() - joints).norm(), 1e-9);
  }
}

TEST(Puma, RefusesUnreachablePosesAndChangesNothing)
{
  Puma puma = makePuma();
  puma.setJoints(FORWARD);
  puma.command(0.05 * Twist::Unit(2));
  accelerate(puma);
  const Joints joints = puma.joints();
  const Joints velocities = puma.velocities();

  const Eigen::Isometry3d far = translation(2.0, 0.0, 0.8);
  const Eigen::Isometry3d in_the_trunk = translation(0.0, 0.0, 0.67);
  Eigen::Isometry3d nan = puma.cameraPose();
  nan(1, 2) = std::numeric_limits<double>::quiet_NaN();
  Eigen::Isometry3d infinite = puma.cameraPose();
  infinite(0, 3) = std::numeric_limits<double>::infinity();
  Eigen::Isometry3d mirrored = puma.cameraPose();
  mirrored.linear().col(0) *= -1.0;
  Eigen::Isometry3d scaled = puma.cameraPose();
  scaled.linear() *= 1.01;
  for (const Eigen::Isometry3d& pose : { far, in_the_trunk, nan, infinite, mirrored, scaled })
  {
    EXPECT_FALSE(puma.setCameraPose(pose)) << pose.matrix();
    EXPECT_EQ(puma.joints(), joints);
    EXPECT_EQ(puma.velocities(), velocities);
    EXPECT_EQ(puma.state(), State::MOVING);
  }
  puma.step(DT);
  EXPECT_LT((puma.velocities() - velocities).norm(), 0.01);
}

TEST(Puma, RefusesJointsBeyondTheirLimitsByName)
{
  Puma puma = makePuma();
  puma.setJoints(FORWARD);
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    for (const double bad : { LOWER(i) - 1e-6, UPPER(i) + 1e-6, std::numeric_limits<double>::quiet_NaN() })
    {
      Joints joints = DOWN;
      joints(i) = bad;
      try
      {
        puma.setJoints(joints);
        ADD_FAILURE() << bad;
      }
      catch (const std::invalid_argument& error)
      {
        expectNamed(error.what(), puma.jointNames()[static_cast<std::size_t>(i)]);
      }
      EXPECT_EQ(puma.joints(), FORWARD);
    }
  }
}

TEST(Puma, HandEyeErrorIsAsLargeAsAskedForAndConstant)
{
  PumaParams params;
  params.hand_eye_translation_error = 0.013;
  params.hand_eye_rotation_error = 0.07;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::uint64_t seed = 1; seed <= 30; ++seed)
  {
    params.seed = seed;
    Puma puma = makePuma(params);
    Puma twin = makePuma(params);
    twin.setJoints(DOWN);
    const auto error = [](const Puma& arm) {
      return arm.nominalCameraPose(arm.joints()).inverse() * arm.cameraPose();
    };
    const Eigen::Isometry3d nominal_from_true = error(puma);
    EXPECT_NEAR(nominal_from_true.translation().norm(), 0.013, 1e-12);
    EXPECT_NEAR(angle(nominal_from_true, Eigen::Isometry3d::Identity()), 0.07, 1e-12);
    EXPECT_TRUE(error(twin).isApprox(nominal_from_true, 1e-12));
    mean += nominal_from_true.translation() / (30.0 * 0.013);
  }
  EXPECT_LT(mean.norm(), 0.5);  // other seeds give other directions
}

TEST(Puma, WithHandEyeErrorTheNominalCameraMovesAsCommanded)
{
  PumaParams params;
  params.hand_eye_translation_error = 0.05;
  params.hand_eye_rotation_error = 0.3;
  Puma puma = makePuma(params);
  puma.setJoints(FORWARD);
  const Twist twist = (Twist() << 0.03, -0.02, 0.04, 0.1, -0.05, 0.1).finished();
  puma.command(twist);
  accelerate(puma);
  const Eigen::Isometry3d nominal = puma.nominalCameraPose(puma.joints());
  const Eigen::Isometry3d camera = puma.cameraPose();
  puma.step(DT);
  EXPECT_LT((twistBetween(nominal, puma.nominalCameraPose(puma.joints()), DT) - twist).norm(), 1e-5);
  EXPECT_GT((twistBetween(camera, puma.cameraPose(), DT) - twist).norm(), 0.01);
}

TEST(Puma, EncodersHaveTheNoiseAskedFor)
{
  PumaParams params;
  params.encoder_noise = 0.002;
  Puma puma = makePuma(params);
  Puma twin = makePuma(params);
  puma.setJoints(FORWARD);
  twin.setJoints(FORWARD);
  constexpr int READINGS = 20000;
  Joints sum = Joints::Zero();
  Joints squares = Joints::Zero();
  for (int i = 0; i < READINGS; ++i)
  {
    const Joints reading = puma.measuredJoints();
    ASSERT_EQ(reading, twin.measuredJoints());
    sum += reading - FORWARD;
    squares += (reading - FORWARD).cwiseAbs2();
  }
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    EXPECT_NEAR(sum(i) / READINGS, 0.0, 5.0 * 0.002 / std::sqrt(READINGS));
    EXPECT_NEAR(std::sqrt(squares(i) / READINGS), 0.002, 5.0 * 0.002 / std::sqrt(2.0 * READINGS));
  }
  EXPECT_EQ(puma.joints(), FORWARD);

  Puma exact = makePuma();
  exact.setJoints(FORWARD);
  EXPECT_EQ(exact.measuredJoints(), FORWARD);
}

TEST(Puma, ListsAllFaultsOfParameters)
{
  EXPECT_TRUE(PumaParams().validate().empty());
  PumaParams params;
  params.base_link.clear();
  params.camera_frame.clear();
  params.max_joint_acceleration = 0.0;
  params.damping = -0.1;
  params.min_manipulability = std::numeric_limits<double>::quiet_NaN();
  params.encoder_noise = std::numeric_limits<double>::infinity();
  params.hand_eye_translation_error = -1.0;
  params.hand_eye_rotation_error = 4.0;
  EXPECT_EQ(params.validate().size(), 8u);
  const std::string message = thrown(pumaUrdf(), params);
  for (const char* name : { "base_link", "camera_frame", "max_joint_acceleration", "damping", "min_manipulability",
                            "encoder_noise", "hand_eye_translation_error", "hand_eye_rotation_error" })
  {
    expectNamed(message, name);
  }
}

TEST(Puma, NamesWhatAUrdfLacks)
{
  EXPECT_EQ(thrown(pumaUrdf()), "");
  for (const char* garbage : { "", "garbage", "<robot", "<html></html>", "<robot name=\"r\"/>" })
  {
    expectNamed(thrown(garbage), "bad URDF:\n  ");
  }
  PumaParams params;
  params.camera_frame = "other_camera";
  expectNamed(thrown(pumaUrdf(), params), "other_camera");
  params = {};
  params.base_link = "other_base";
  expectNamed(thrown(pumaUrdf(), params), "other_base");
  params = {};
  params.base_link = "camera_link";
  params.camera_frame = "link6";
  expectNamed(thrown(pumaUrdf(), params), "camera_link does not carry link6");
  params = {};
  params.camera_frame = "link5";
  expectNamed(thrown(pumaUrdf(), params), "5 moving joints");
  params = {};
  params.base_link = params.camera_frame;
  expectNamed(thrown(pumaUrdf(), params), "0 moving joints");

  const std::string limit = "<limit lower=\"-3.9270\" upper=\"0.7854\" velocity=\"2.13\" effort=\"89.4\"/>";
  expectNamed(thrown(edited(pumaUrdf(), limit, "")), "joint3");
  expectNamed(thrown(edited(pumaUrdf(), limit, "<limit velocity=\"2.13\" effort=\"89.4\"/>")), "joint3 needs limits");
  expectNamed(thrown(edited(pumaUrdf(), limit, "<limit lower=\"1\" upper=\"-1\" velocity=\"2.13\" effort=\"89.4\"/>")),
              "joint3 needs limits");
  expectNamed(thrown(edited(pumaUrdf(), limit, "<limit lower=\"-1\" upper=\"1\" velocity=\"0\" effort=\"89.4\"/>")),
              "joint3 needs a velocity limit");
  expectNamed(thrown(edited(pumaUrdf(), "<joint name=\"joint3\" type=\"revolute\">",
                            "<joint name=\"joint3\" type=\"prismatic\">")),
              "joint3 is not revolute");
  expectNamed(
      thrown(edited(pumaUrdf(), "<joint name=\"joint3\" type=\"revolute\">", "<joint name=\"joint3\" type=\"fixed\">")),
      "5 moving joints");
  expectNamed(thrown(edited(pumaUrdf(), "<joint name=\"flange_joint\" type=\"fixed\">",
                            "<joint name=\"joint7\" type=\"continuous\">")),
              "joint7 is not revolute");
}

TEST(Puma, RefusesEveryBeginningOfAUrdf)
{
  const std::string whole = pumaUrdf();
  for (std::size_t length = 0; length + 10 < whole.size(); length += 97)
  {
    EXPECT_NE(thrown(whole.substr(0, length)), "") << length;
  }
}

}  // namespace
}  // namespace view_servo::sim
