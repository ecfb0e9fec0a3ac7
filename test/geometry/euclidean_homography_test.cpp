// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/euclidean_homography.h"

#include "../support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
Points referencePoints(const test::Scene& scene)
{
  Points points;
  for (const Correspondence& pair : scene.pairs)
  {
    points.push_back(pair.reference);
  }
  return points;
}

double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

}  // namespace

TEST(DecomposeHomography, OneOfAtMostTwoIsTheTruth)
{
  Rng rng(1);
  int ambiguous = 0;
  for (int trial = 0; trial < 200; ++trial)
  {
    test::SceneOptions options;
    options.planar = true;
    options.inliers = 30;
    const test::Scene scene = test::makeScene(options, rng);
    const double scale = (trial % 2 == 0 ? 1.0 : -1.0) * uniform(rng, 0.1, 10.0);
    const auto solutions = decomposeHomography(scale * scene.homography, scene.k, referencePoints(scene));
    ASSERT_GE(solutions.size(), 1U) << trial;
    ASSERT_LE(solutions.size(), 2U) << trial;
    ambiguous += solutions.size() == 2U ? 1 : 0;
    const bool found = std::any_of(solutions.begin(), solutions.end(), [&](const EuclideanHomography& solution) {
      return angleBetween(solution.rotation, scene.r) < 1e-6 &&
             (solution.translation_over_distance - scene.t / scene.d).norm() < 1e-6 &&
             (solution.normal - scene.n).norm() < 1e-6;
    });
    EXPECT_TRUE(found) << trial;
    for (const EuclideanHomography& solution : solutions)
    {
      EXPECT_NEAR(solution.normal.norm(), 1.0, 1e-9);
      EXPECT_NEAR(solution.rotation.determinant(), 1.0, 1e-9);
      EXPECT_LT(test::projectiveDistance(scene.k * solution.matrix() * scene.k.inverse(), scene.homography), 1e-6);
      EXPECT_GT(solution.matrix().determinant(), 0.0);
    }
  }
  EXPECT_GT(ambiguous, 20);
  EXPECT_LT(ambiguous, 200);
}

TEST(DecomposeHomography, ATurnHasNoNormal)
{
  Rng rng(2);
  test::SceneOptions options;
  options.planar = true;
  const test::Scene scene = test::makeScene(options, rng);
  const Eigen::Matrix3d turn = test::randomRotation(rng, 0.1);
  const auto solutions =
      decomposeHomography(scene.k * turn * scene.k.inverse(), scene.k, { { 300.0, 200.0 }, { 350.0, 250.0 } });
  ASSERT_EQ(solutions.size(), 1U);
  EXPECT_LT(angleBetween(solutions[0].rotation, turn), 1e-6);
  EXPECT_EQ(solutions[0].translation_over_distance.norm(), 0.0);
  EXPECT_TRUE(std::isnan(solutions[0].normal.x()));
}

TEST(DecomposeHomography, NoneForWhatCanNotBeSeen)
{
  Rng rng(3);
  test::SceneOptions options;
  options.planar = true;
  const test::Scene scene = test::makeScene(options, rng);
  const Points seen = referencePoints(scene);
  EXPECT_TRUE(decomposeHomography(Eigen::Matrix3d::Zero(), scene.k, seen).empty());
  EXPECT_TRUE(
      decomposeHomography(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()), scene.k, seen).empty());
  EXPECT_TRUE(decomposeHomography(scene.homography, scene.k, {}).empty());
  // A mirror image: the plane from behind.
  const Eigen::Matrix3d mirror = Eigen::Vector3d(-1.0, 1.0, 1.0).asDiagonal();
  EXPECT_TRUE(decomposeHomography(scene.k * mirror * scene.k.inverse() * scene.homography, scene.k, seen).empty());
}

}  // namespace view_servo
