// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/odometry_scale.h"

#include "support/synthetic_scene.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double METRES = 0.7;  // of a unit

/** Where a camera is on a way of half a metre, and what it sees of that. */
std::vector<MeasuredWay> waysWith(double noise, std::uint64_t seed)
{
  Rng rng(seed);
  const Eigen::Isometry3d odom_from_view =
      Eigen::Translation3d(0.4, -0.2, 0.3) * Eigen::Quaterniond(test::randomRotation(rng, 0.5));
  const Eigen::Vector3d begin = Eigen::Vector3d(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), -1.0).normalized();
  std::vector<MeasuredWay> ways;
  for (int i = 0; i < 25; ++i)
  {
    Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
    camera.translation() = 0.02 * i * begin;
    camera.linear() = test::randomRotation(rng, 0.3);
    const Eigen::Vector3d error = noise * Eigen::Vector3d(gaussian(rng), gaussian(rng), gaussian(rng));
    ways.push_back({ camera.inverse().translation() / METRES + error, odom_from_view * camera });
  }
  return ways;
}

}  // namespace

TEST(OdometryScale, IsExactWithoutNoise)
{
  const auto scale = scaleByOdometry(waysWith(0.0, 1), 0.1);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->metres, METRES, 1e-12);
  EXPECT_LT(scale->relative_deviation, 1e-6);
}

TEST(OdometryScale, IsNotToldWhereTheCameraHasHardlyMoved)
{
  EXPECT_TRUE(scaleByOdometry(waysWith(0.0, 1), 0.45));
  EXPECT_FALSE(scaleByOdometry(waysWith(0.0, 1), 0.5));
  EXPECT_FALSE(scaleByOdometry({}, 0.1));
  std::vector<MeasuredWay> backwards = waysWith(0.0, 1);
  for (MeasuredWay& way : backwards)
  {
    way.translation *= -1.0;
  }
  EXPECT_FALSE(scaleByOdometry(backwards, 0.1)) << "odometry says the contrary";
}

TEST(OdometryScale, KnowsHowExactItIs)
{
  constexpr int RUNS = 400;
  double squares = 0.0;
  for (std::uint64_t seed = 1; seed <= RUNS; ++seed)
  {
    const auto scale = scaleByOdometry(waysWith(0.02, seed), 0.1);
    ASSERT_TRUE(scale);
    squares += std::pow((METRES / scale->metres - 1.0) / scale->relative_deviation, 2) / RUNS;
  }
  EXPECT_NEAR(squares, 1.0, 0.25);
}

}  // namespace view_servo
