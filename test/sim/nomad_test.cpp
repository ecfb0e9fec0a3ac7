// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/nomad.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
constexpr double DT = 0.01;  // [s]

/** An empty floor with a post 2 m ahead. */
World emptyWorld()
{
  World world;
  world.camera_on_base.translation().z() = 0.9;
  world.camera_on_base.linear() << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  world.obstacles = { { "the post", { { 2.0, -0.1 }, { 2.2, -0.1 }, { 2.2, 0.1 }, { 2.0, 0.1 } } } };
  return world;
}

void run(Nomad& nomad, double duration)
{
  for (int i = 0; i < static_cast<int>(std::lround(duration / DT)); ++i)
  {
    nomad.step(DT);
  }
}

double apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return (a.translation() - b.translation()).norm();
}

}  // namespace

TEST(Nomad, MovesInAnyDirectionWithoutTurning)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.setPose(planarPose(0.0, 0.0, 0.5));
  ASSERT_TRUE(nomad.command({ 0.0, 0.3, 0.0 }));  // to its left
  run(nomad, 0.3 + 1.0);                          // 0.3 s to gather speed
  const double distance = 0.3 * 0.3 / 2.0 + 0.3 * 1.0;
  EXPECT_NEAR(nomad.pose().translation().x(), -distance * std::sin(0.5), 0.005);
  EXPECT_NEAR(nomad.pose().translation().y(), distance * std::cos(0.5), 0.005);
  EXPECT_NEAR(yawOf(nomad.pose()), 0.5, 1e-12);
  EXPECT_EQ(nomad.pose().translation().z(), 0.0);
}

TEST(Nomad, TurnsToTheLeftForPositiveRates)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.command({ 0.0, 0.0, 0.5 });
  run(nomad, 1.0);
  EXPECT_NEAR(yawOf(nomad.pose()), 0.5 * (1.0 - 0.125), 0.01);
  EXPECT_LT(nomad.pose().translation().norm(), 1e-12);
}

TEST(Nomad, DrivesCircles)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.command({ 0.2, 0.0, 0.5 });
  run(nomad, 2.0);
  const Eigen::Isometry3d start = nomad.pose();
  run(nomad, 2.0 * M_PI / 0.5);  // once round, to the nearest step
  EXPECT_LT(apart(start, nomad.pose()), 0.003);
}

TEST(Nomad, KeepsItsLimits)
{
  const World world = emptyWorld();
  NomadParams params;
  Nomad nomad(world, params);
  nomad.command({ -30.0, 40.0, -9.0 });
  Nomad::Velocity last = nomad.velocity();
  for (int i = 0; i < 300; ++i)
  {
    if (i == 150)
    {
      nomad.command(Nomad::Velocity::Zero());
    }
    nomad.step(DT);
    const Nomad::Velocity now = nomad.velocity();
    EXPECT_LE(now.head<2>().norm(), params.max_speed + 1e-12);
    EXPECT_LE(std::abs(now.z()), params.max_turn_rate + 1e-12);
    EXPECT_LE((now - last).head<2>().norm(), params.max_acceleration * DT + 1e-12);
    EXPECT_LE(std::abs(now.z() - last.z()), params.max_turn_acceleration * DT + 1e-12);
    last = now;
  }
  EXPECT_EQ(last, Nomad::Velocity::Zero());
}

TEST(Nomad, RefusesCommandsThatAreNotFinite)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.command({ 0.2, 0.0, 0.0 });
  EXPECT_FALSE(nomad.command({ std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0 }));
  EXPECT_FALSE(nomad.command({ 0.0, std::numeric_limits<double>::infinity(), 0.0 }));
  run(nomad, 1.0);
  EXPECT_NEAR(nomad.velocity().x(), 0.2, 1e-12);
}

TEST(Nomad, OdometryFollowsThePoseWhenItIsPerfect)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.setPose(planarPose(-1.0, 0.5, 0.8));
  const Eigen::Isometry3d odometry = nomad.odometry();
  const Eigen::Isometry3d pose = nomad.pose();
  nomad.command({ 0.3, -0.2, 0.4 });
  run(nomad, 3.0);
  EXPECT_TRUE((odometry.inverse() * nomad.odometry()).isApprox(pose.inverse() * nomad.pose(), 1e-9));
  EXPECT_TRUE(nomad.measuredVelocity().isApprox(nomad.velocity(), 1e-9));
}

TEST(Nomad, OdometryDriftsAsAsked)
{
  const World world = emptyWorld();
  NomadParams params;
  params.odometry_drift = 0.05;
  params.odometry_turn_drift = 0.1;
  Nomad nomad(world, params);
  nomad.command({ 0.0, 0.5, 0.0 });
  run(nomad, 2.25);  // 1 m
  EXPECT_NEAR(nomad.pose().translation().norm(), 1.0, 0.01);
  EXPECT_NEAR(yawOf(nomad.odometry()), 0.1, 0.002);
  EXPECT_NEAR(nomad.odometry().translation().norm(), 1.05, 0.01);
}

TEST(Nomad, OdometryNoiseIsTheSameForTheSameSeed)
{
  const World world = emptyWorld();
  NomadParams params;
  params.odometry_noise = 0.2;
  const auto measured = [&](std::uint64_t seed) {
    params.seed = seed;
    Nomad nomad(world, params);
    nomad.command({ 0.3, 0.1, 0.2 });
    run(nomad, 1.0);
    return nomad.odometry();
  };
  EXPECT_TRUE(measured(1).isApprox(measured(1), 0.0));
  EXPECT_GT(apart(measured(1), measured(2)), 1e-6);
}

TEST(Nomad, OdometryNoiseDoesNotDependOnTheSteps)
{
  const World world = emptyWorld();
  NomadParams params;
  params.odometry_noise = 0.2;
  // How far odometry is off after 1 s, in the root mean square of runs, is the noise of a step by the root of their number.
  const auto error = [&](double dt) {
    constexpr int RUNS = 60;
    double squares = 0.0;
    for (int i = 0; i < RUNS; ++i)
    {
      params.seed = i;
      Nomad nomad(world, params);
      nomad.command({ 0.0, 0.2, 0.0 });
      for (int k = 0; k < std::lround(1.0 / dt); ++k)
      {
        nomad.step(dt);
      }
      squares += std::pow(apart(nomad.odometry(), nomad.pose()) / nomad.pose().translation().norm(), 2);
    }
    return std::sqrt(squares / RUNS);
  };
  for (const double dt : { 0.02, 0.01, 0.004 })
  {
    EXPECT_NEAR(error(dt) / (params.odometry_noise * std::sqrt(0.02)), 1.1, 0.3) << dt;
  }
}

TEST(Nomad, StopsAtObstaclesAndNamesThem)
{
  const World world = emptyWorld();
  NomadParams params;
  Nomad nomad(world, params);
  nomad.command({ 0.4, 0.0, 0.0 });
  run(nomad, 8.0);
  EXPECT_NEAR(nomad.pose().translation().x(), 2.0 - params.radius, 0.01);
  EXPECT_EQ(nomad.blockedBy(), "the post");
  nomad.command({ -0.4, 0.0, 0.0 });
  run(nomad, 1.0);
  EXPECT_EQ(nomad.blockedBy(), "");
  EXPECT_LT(nomad.pose().translation().x(), 1.6);
}

TEST(Nomad, RefusesToStandInAnObstacle)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.setPose(planarPose(0.3, 0.2, 0.1));
  const Eigen::Isometry3d before = nomad.pose();
  try
  {
    nomad.setPose(planarPose(2.1, 0.0, 0.0));
    FAIL() << "stands in the post";
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("the post"), std::string::npos) << error.what();
  }
  Eigen::Isometry3d nowhere = before;
  nowhere.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(nomad.setPose(nowhere), std::invalid_argument);
  EXPECT_TRUE(nomad.pose().isApprox(before, 0.0));
}

TEST(Nomad, TheCameraLooksAhead)
{
  const World world = emptyWorld();
  Nomad nomad(world, {});
  nomad.setPose(planarPose(1.0, 2.0, M_PI / 2.0));
  const Eigen::Isometry3d camera = nomad.cameraPose();
  EXPECT_TRUE(camera.translation().isApprox(Eigen::Vector3d(1.0, 2.0, 0.9)));
  EXPECT_TRUE(camera.linear().col(2).isApprox(Eigen::Vector3d::UnitY()));   // forward
  EXPECT_TRUE(camera.linear().col(0).isApprox(Eigen::Vector3d::UnitX()));   // right
  EXPECT_TRUE(camera.linear().col(1).isApprox(-Eigen::Vector3d::UnitZ()));  // down
}

TEST(Nomad, OdometryTellsTheWheelsWhileTheySlip)
{
  const World world = emptyWorld();
  NomadParams params;
  params.slip_share = 0.3;
  params.slip_loss = 0.5;
  Nomad nomad(world, params);
  nomad.command({ -0.4, 0.0, 0.0 });
  run(nomad, 1.0);
  constexpr int STEPS = 100000;
  int slipping = 0;
  int spells = 0;
  bool slipped = false;
  for (int i = 0; i < STEPS; ++i)
  {
    const double before = nomad.pose().translation().x();
    const double measured_before = nomad.odometry().translation().x();
    nomad.step(DT);
    const double way = before - nomad.pose().translation().x();
    EXPECT_NEAR(measured_before - nomad.odometry().translation().x(), 0.4 * DT, 1e-9);
    const bool slips = way < 0.3 * DT;
    EXPECT_NEAR(way, (slips ? 0.2 : 0.4) * DT, 1e-9);
    slipping += slips ? 1 : 0;
    spells += slips && !slipped ? 1 : 0;
    slipped = slips;
  }
  EXPECT_NEAR(static_cast<double>(slipping) / STEPS, 0.3, 0.03);
  EXPECT_NEAR(slipping * DT / spells, params.slip_duration, 0.1);
}

TEST(Nomad, SlipsTheSameWayForTheSameSeed)
{
  const World world = emptyWorld();
  NomadParams params;
  params.slip_share = 0.3;
  const auto driven = [&](std::uint64_t seed) {
    params.seed = seed;
    Nomad nomad(world, params);
    nomad.command({ -0.3, 0.0, 0.2 });
    run(nomad, 5.0);
    return nomad.pose().matrix();
  };
  EXPECT_EQ(driven(1), driven(1));
  EXPECT_NE(driven(1), driven(2));
}

TEST(Nomad, NamesAllFaultsOfItsParameters)
{
  const World world = emptyWorld();
  NomadParams params;
  params.max_speed = 0.0;
  params.radius = -1.0;
  params.odometry_noise = std::numeric_limits<double>::quiet_NaN();
  params.slip_share = 1.0;
  EXPECT_EQ(params.validate().size(), 4U);
  EXPECT_THROW(Nomad(world, params), std::invalid_argument);
}

}  // namespace view_servo::sim
