// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/puma.h"
#include "test_paths.h"

#include <gtest/gtest.h>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
using Joints = Puma::Joints;
using State = Puma::State;
using Twist = Puma::Twist;

constexpr double DEGREE = M_PI / 180.0;
constexpr double DT = 0.001;  // [s]

/** Of the URDF, written down again. */
const Joints LOWER = (Joints() << -2.7925, -0.7854, -3.9270, -1.9199, -1.7453, -4.6426).finished();
const Joints UPPER = (Joints() << 2.7925, 3.9270, 0.7854, 2.9671, 1.7453, 4.6426).finished();
const Joints MAX_VELOCITY = (Joints() << 1.43, 1.29, 2.13, 3.98, 4.20, 3.98).finished();

/** The URDF's convenient configurations. */
const Joints FORWARD = (Joints() << 0.0, 0.9, -3.05, 0.0, 0.579204, 0.0).finished();
const Joints DOWN = (Joints() << 0.0, 1.2, -3.1, 0.0, -1.241593, 0.0).finished();

std::string urdf()
{
  std::ifstream file(PACKAGE_DIR "/urdf/puma560.urdf");
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/** With the only occurrence of `from` replaced. */
std::string edited(const std::string& from, const std::string& to)
{
  std::string text = urdf();
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  EXPECT_EQ(text.find(from, at + 1), std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

Puma makePuma(const PumaParams& params = {})
{
  return Puma(urdf(), params);
}

Joints randomJoints(Rng& rng)
{
  Joints joints;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    joints(i) = uniform(rng, LOWER(i), UPPER(i));
  }
  return joints;
}

/** Normally distributed, with deviations in m/s and rad/s. */
Twist randomTwist(Rng& rng, double linear, double angular)
{
  Twist twist;
  for (int i = 0; i < 6; ++i)
  {
    twist(i) = (i < 3 ? linear : angular) * gaussian(rng);
  }
  return twist;
}

Eigen::Isometry3d translation(double x, double y, double z)
{
  return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
}

Eigen::Isometry3d rotation(double angle, const Eigen::Vector3d& axis)
{
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, axis));
}

/** base_link from the optical frame by the Denavit-Hartenberg table. */
Eigen::Isometry3d denavitHartenberg(const Joints& q)
{
  const double d[] = { 0.67, 0.0, 0.15005, 0.4318, 0.0, 0.05625 };
  const double a[] = { 0.0, 0.4318, 0.0203, 0.0, 0.0, 0.0 };
  const double alpha[] = { 90.0, 0.0, -90.0, 90.0, -90.0, 0.0 };
  Eigen::Isometry3d flange = Eigen::Isometry3d::Identity();
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    const double ct = std::cos(q(i));
    const double st = std::sin(q(i));
    const double ca = std::cos(alpha[i] * DEGREE);
    const double sa = std::sin(alpha[i] * DEGREE);
    Eigen::Matrix4d m;
    m << ct, -st * ca, st * sa, a[i] * ct,  //
        st, ct * ca, -ct * sa, a[i] * st,   //
        0.0, sa, ca, d[i],                  //
        0.0, 0.0, 0.0, 1.0;
    flange = flange * Eigen::Isometry3d(m);
  }
  Eigen::Isometry3d camera = translation(-0.045, 0.0, 0.06);
  camera.linear() << 0.0, 1.0, 0.0,  //
      -1.0, 0.0, 0.0,                //
      0.0, 0.0, 1.0;
  return flange * camera;
}

/** Pose after moving on with a twist of the own frame for a short time; error of third order in the time. */
Eigen::Isometry3d moved(const Eigen::Isometry3d& pose, const Twist& twist, double dt)
{
  const Eigen::Vector3d turn = dt * twist.tail<3>();
  const double angle = turn.norm();
  const Eigen::Vector3d axis = angle > 0.0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d::UnitX();
  Eigen::Isometry3d next = pose * rotation(angle, axis);
  next.translation() = pose * (rotation(0.5 * angle, axis) * Eigen::Vector3d(dt * twist.head<3>()));
  return next;
}

/** The twist of `moved`. */
Twist twistBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double dt)
{
  const Eigen::Isometry3d relative = from.inverse() * to;
  const Eigen::AngleAxisd turn(relative.linear());
  Twist twist;
  twist << rotation(-0.5 * turn.angle(), turn.axis()) * Eigen::Vector3d(relative.translation()) / dt,
      turn.angle() * turn.axis() / dt;
  return twist;
}

double distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return (a.translation() - b.translation()).norm();
}

double angle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return 2.0 * std::asin((a.linear() - b.linear()).norm() / std::sqrt(8.0));
}

/** Joint velocities -> twist, by differences of poses. */
Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>> decomposedJacobian(const Puma& puma, const Joints& joints)
{
  constexpr double STEP = 1e-5;
  Eigen::Matrix<double, 6, 6> jacobian;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    const Joints step = STEP * Joints::Unit(i);
    jacobian.col(i) =
        twistBetween(puma.nominalCameraPose(joints - step), puma.nominalCameraPose(joints + step), 2.0 * STEP);
  }
  return Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>>(jacobian, Eigen::ComputeFullU);
}

/** Smallest singular value of the Jacobian. */
double manipulability(const Puma& puma, const Joints& joints)
{
  return decomposedJacobian(puma, joints).singularValues()(5);
}

/** Both configurations, and ones near them, all well away from limits and singularities. */
Joints usualJoints(Rng& rng)
{
  Joints joints = uniform(rng, 0.0, 1.0) < 0.5 ? FORWARD : DOWN;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    joints(i) += uniform(rng, -0.2, 0.2);
  }
  return joints;
}

/** Until it neither accelerates nor brakes any more. */
void accelerate(Puma& puma)
{
  for (int i = 0; i < 500; ++i)
  {
    puma.step(DT);
  }
}

std::string thrown(const std::string& urdf_xml, const PumaParams& params = {})
{
  try
  {
    Puma(urdf_xml, params);
  }
  catch (const std::invalid_argument& error)
  {
    return error.what();
  }
  return "";
}

void expectNamed(const std::string& message, const std::string& name)
{
  EXPECT_NE(message.find(name), std::string::npos) << "\"" << message << "\" does not name " << name;
}

TEST(PumaTest, PosesAreThoseOfItsDenavitHartenbergTable)
{
  const Puma puma = makePuma();
  Rng rng(1);
  for (int i = 0; i < 1000; ++i)
  {
    const Joints joints = randomJoints(rng);
    EXPECT_TRUE(puma.nominalCameraPose(joints).isApprox(denavitHartenberg(joints), 1e-12)) << joints.transpose();
  }
}

TEST(PumaTest, StartsAtRest)
{
  const Puma puma = makePuma();
  EXPECT_EQ(puma.jointNames(),
            (std::vector<std::string>{ "joint1", "joint2", "joint3", "joint4", "joint5", "joint6" }));
  EXPECT_EQ(puma.joints(), Joints::Zero());
  EXPECT_EQ(puma.velocities(), Joints::Zero());
  EXPECT_EQ(puma.state(), State::STILL);
  EXPECT_EQ(puma.message(), "");
}

TEST(PumaTest, LooksWhereTheUrdfSays)
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

TEST(PumaTest, CameraMovesAsCommanded)
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

TEST(PumaTest, CameraMovesAlongEachAxisAsCommanded)
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

TEST(PumaTest, TheWayDoesNotDependOnTheLengthOfSteps)
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

TEST(PumaTest, StopsWithinTheAccelerationLimit)
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

TEST(PumaTest, NeverExceedsAnyLimit)
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

TEST(PumaTest, SlowsDownAtAVelocityLimitInTheSameDirection)
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

TEST(PumaTest, StopsAtEveryEndNamesItAndLeavesItAgain)
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

TEST(PumaTest, CameraStaysOnItsPathUntilTheEnd)
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

TEST(PumaTest, AtAnEndItFollowsTwistsThatDoNotNeedThatJoint)
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

TEST(PumaTest, SlowsDownAndReportsWhereItIsSingular)
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

TEST(PumaTest, SlowsDownOnTheWayIntoTheStretchedArm)
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

TEST(PumaTest, IsDampedNearSingularitiesAsTheParametersSay)
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

TEST(PumaTest, IsNotDampedAwayFromSingularities)
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

TEST(PumaTest, ReachesCameraPosesThatJointsGave)
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

TEST(PumaTest, TakesTheNearestSolution)
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

TEST(PumaTest, StaysWhereThePoseIsItsOwn)
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

TEST(PumaTest, RefusesUnreachablePosesAndChangesNothing)
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

TEST(PumaTest, RefusesTwistsThatAreNotFiniteAndKeepsTheFormer)
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

TEST(PumaTest, SurvivesEnormousAndTinyTwists)
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

TEST(PumaTest, RefusesTimesThatItCannotMoveOn)
{
  Puma puma = makePuma();
  for (const double dt :
       { 0.0, -0.001, 61.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity() })
  {
    EXPECT_THROW(puma.step(dt), std::invalid_argument) << dt;
  }
}

TEST(PumaTest, RefusesJointsBeyondTheirLimitsByName)
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

TEST(PumaTest, HandEyeErrorIsAsLargeAsAskedForAndConstant)
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

TEST(PumaTest, WithHandEyeErrorTheNominalCameraMovesAsCommanded)
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

TEST(PumaTest, EncodersHaveTheNoiseAskedFor)
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

TEST(PumaTest, ListsAllFaultsOfParameters)
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
  const std::string message = thrown(urdf(), params);
  for (const char* name : { "base_link", "camera_frame", "max_joint_acceleration", "damping", "min_manipulability",
                            "encoder_noise", "hand_eye_translation_error", "hand_eye_rotation_error" })
  {
    expectNamed(message, name);
  }
}

TEST(PumaTest, NamesWhatAUrdfLacks)
{
  EXPECT_EQ(thrown(urdf()), "");
  for (const char* garbage : { "", "garbage", "<robot", "<html></html>", "<robot name=\"r\"/>" })
  {
    expectNamed(thrown(garbage), "bad URDF:\n  ");
  }
  PumaParams params;
  params.camera_frame = "other_camera";
  expectNamed(thrown(urdf(), params), "other_camera");
  params = {};
  params.base_link = "other_base";
  expectNamed(thrown(urdf(), params), "other_base");
  params = {};
  params.base_link = "camera_link";
  params.camera_frame = "link6";
  expectNamed(thrown(urdf(), params), "camera_link does not carry link6");
  params = {};
  params.camera_frame = "link5";
  expectNamed(thrown(urdf(), params), "5 moving joints");
  params = {};
  params.base_link = params.camera_frame;
  expectNamed(thrown(urdf(), params), "0 moving joints");

  const std::string limit = "<limit lower=\"-3.9270\" upper=\"0.7854\" velocity=\"2.13\" effort=\"89.4\"/>";
  expectNamed(thrown(edited(limit, "")), "joint3");
  expectNamed(thrown(edited(limit, "<limit velocity=\"2.13\" effort=\"89.4\"/>")), "joint3 needs limits");
  expectNamed(thrown(edited(limit, "<limit lower=\"1\" upper=\"-1\" velocity=\"2.13\" effort=\"89.4\"/>")),
              "joint3 needs limits");
  expectNamed(thrown(edited(limit, "<limit lower=\"-1\" upper=\"1\" velocity=\"0\" effort=\"89.4\"/>")),
              "joint3 needs a velocity limit");
  expectNamed(thrown(edited("<joint name=\"joint3\" type=\"revolute\">", "<joint name=\"joint3\" type=\"prismatic\">")),
              "joint3 is not revolute");
  expectNamed(thrown(edited("<joint name=\"joint3\" type=\"revolute\">", "<joint name=\"joint3\" type=\"fixed\">")),
              "5 moving joints");
  expectNamed(
      thrown(edited("<joint name=\"flange_joint\" type=\"fixed\">", "<joint name=\"joint7\" type=\"continuous\">")),
      "joint7 is not revolute");
}

TEST(PumaTest, RefusesEveryBeginningOfAUrdf)
{
  const std::string whole = urdf();
  for (std::size_t length = 0; length + 10 < whole.size(); length += 97)
  {
    EXPECT_NE(thrown(whole.substr(0, length)), "") << length;
  }
}

}  // namespace
}  // namespace view_servo::sim
