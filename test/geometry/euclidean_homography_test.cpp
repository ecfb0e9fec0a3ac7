// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/euclidean_homography.h"

#include "support/synthetic_scene.h"

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

TEST(MotionBefore, IsThatOfTheSceneHoweverShort)
{
  Rng rng(4);
  for (int trial = 0; trial < 100; ++trial)
  {
    test::SceneOptions options;
    options.planar = true;
    options.inliers = 10;
    const test::Scene scene = test::makeScene(options, rng);
    const double part = trial % 2 == 0 ? 1.0 : 1e-6;  // of the way
    const EuclideanHomography truth{ scene.r, part * scene.t / scene.d, scene.n };
    const Eigen::Matrix3d h = uniform(rng, -5.0, -0.1) * (scene.k * truth.matrix() * scene.k.inverse());
    const Eigen::Matrix3d calibrated = calibratedHomography(h, scene.k, referencePoints(scene));
    EXPECT_LT((calibrated - truth.matrix()).norm(), 1e-9);
    const EuclideanHomography found = motionBefore(calibrated, scene.n);
    EXPECT_LT(angleBetween(found.rotation, scene.r), 1e-7) << trial;
    EXPECT_LT((found.translation_over_distance - truth.translation_over_distance).norm(), 1e-8) << trial;
  }
}

TEST(MovedOn, ComposesMotions)
{
  Rng rng(5);
  const Eigen::Vector3d normal = test::randomRotation(rng, 0.4) * Eigen::Vector3d::UnitZ();
  const double distance = 0.7;
  Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  first.linear() = test::randomRotation(rng, 0.5);
  first.translation() = Eigen::Vector3d(0.1, -0.2, 0.05);
  Eigen::Isometry3d second = Eigen::Isometry3d::Identity();
  second.linear() = test::randomRotation(rng, 0.5);
  second.translation() = Eigen::Vector3d(-0.3, 0.1, 0.15);
  const EuclideanHomography before{ first.linear(), first.translation() / distance, normal };
  const EuclideanHomography after = movedOn(before, second, distance);
  const Eigen::Isometry3d both = second * first;
  EXPECT_LT((after.rotation - both.linear()).norm(), 1e-12);
  EXPECT_LT((distance * after.translation_over_distance - both.translation()).norm(), 1e-12);
  EXPECT_EQ(after.normal, normal);
  // Without a distance the turn alone counts.
  const EuclideanHomography turned = movedOn(before, second, std::numeric_limits<double>::infinity());
  EXPECT_LT((turned.rotation - both.linear()).norm(), 1e-12);
  EXPECT_LT((turned.translation_over_distance - second.linear() * before.translation_over_distance).norm(), 1e-12);
}

TEST(NearestRotation, MendsWhatIsNearlyOne)
{
  Rng rng(6);
  for (int trial = 0; trial < 50; ++trial)
  {
    const Eigen::Matrix3d rotation = test::randomRotation(rng, 3.0);
    EXPECT_LT((nearestRotation(3.0 * rotation) - rotation).norm(), 1e-9);
    // Two of its directions are enough.
    const Eigen::Vector3d without = test::randomRotation(rng, 3.0) * Eigen::Vector3d::UnitX();
    const Eigen::Matrix3d along = rotation * (Eigen::Matrix3d::Identity() - without * without.transpose());
    EXPECT_LT((nearestRotation(along) - rotation).norm(), 1e-9);
  }
}

}  // namespace view_servo
