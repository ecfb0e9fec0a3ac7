// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/essential.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/relative_pose_estimator.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <vector>

namespace view_servo
{
namespace
{
/** Points in front of two cameras of a random motion. */
struct Problem
{
  RelativePose motion;
  Correspondences pairs;

  Problem(std::uint64_t seed, int count, double noise)
  {
    Rng rng(seed);
    const Eigen::Vector3d axis =
        Eigen::Vector3d(uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0)).normalized();
    motion.rotation = Eigen::AngleAxisd(uniform(rng, 0.05, 0.5), axis).toRotationMatrix();
    motion.translation =
        Eigen::Vector3d(uniform(rng, -1.0, 1.0), uniform(rng, -0.5, 0.5), uniform(rng, -1.0, 1.0)).normalized();
    while (static_cast<int>(pairs.size()) < count)
    {
      const double depth = uniform(rng, 3.0, 8.0);
      const Eigen::Vector3d point(depth * uniform(rng, -0.6, 0.6), depth * uniform(rng, -0.5, 0.5), depth);
      const Eigen::Vector3d moved = motion.rotation * point + motion.translation;
      if (moved.z() > 0.5)
      {
        const Eigen::Vector2d error(gaussian(rng), gaussian(rng));
        pairs.push_back({ point.hnormalized(), moved.hnormalized() + noise * error });
      }
    }
  }

  double rotationError(const RelativePose& found) const
  {
    return Eigen::AngleAxisd(found.rotation * motion.rotation.transpose()).angle();
  }
  double directionError(const RelativePose& found) const
  {
    return std::acos(std::clamp(found.translation.dot(motion.translation), -1.0, 1.0));
  }
};

TEST(Essential, HoldsForAllPointsOfItsMotion)
{
  const Problem problem(1, 50, 0.0);
  for (const Correspondence& pair : problem.pairs)
  {
    EXPECT_NEAR(pair.current.homogeneous().dot(problem.motion.essential() * pair.reference.homogeneous()), 0.0, 1e-12);
  }
}

TEST(Essential, CrossMatrixMultipliesAsTheCrossProduct)
{
  const Eigen::Vector3d v(1.0, -2.0, 0.5);
  const Eigen::Vector3d w(0.3, 0.7, -4.0);
  EXPECT_LT((crossMatrix(v) * w - v.cross(w)).norm(), 1e-12);
}

TEST(Essential, FivePointsGiveTheTrueOneAmongTheirs)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    const Problem problem(seed, 5, 0.0);
    const Eigen::Matrix3d truth = problem.motion.essential().normalized();
    double least = 1.0;
    for (const Eigen::Matrix3d& found : essentialFromFivePoints(problem.pairs))
    {
      const Eigen::Matrix3d unit = found.normalized();
      least = std::min({ least, (unit - truth).norm(), (unit + truth).norm() });
    }
    EXPECT_LT(least, 1e-5) << "seed " << seed;
  }
  EXPECT_TRUE(essentialFromFivePoints(Problem(1, 4, 0.0).pairs).empty());
  EXPECT_TRUE(essentialFromFivePoints(Problem(1, 6, 0.0).pairs).empty());
}

TEST(Essential, OneOfItsFourMotionsIsTheTrueOne)
{
  const Problem problem(3, 5, 0.0);
  const std::vector<RelativePose> poses = posesFromEssential(-2.0 * problem.motion.essential());
  ASSERT_EQ(poses.size(), 4u);
  int right = 0;
  for (const RelativePose& pose : poses)
  {
    EXPECT_NEAR(pose.rotation.determinant(), 1.0, 1e-9);
    right += problem.rotationError(pose) < 1e-6 && problem.directionError(pose) < 1e-6 ? 1 : 0;
  }
  EXPECT_EQ(right, 1);
}

TEST(Essential, CovarianceIsThatOfMotionsFittedToManyDraws)
{
  constexpr double NOISE = 1e-3;
  constexpr int DRAWS = 400;
  const Problem problem(7, 60, 0.0);
  Rng rng(11);
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (int draw = 0; draw < DRAWS; ++draw)
  {
    Correspondences noisy = problem.pairs;
    for (Correspondence& pair : noisy)
    {
      pair.reference += NOISE * Eigen::Vector2d(gaussian(rng), gaussian(rng));
      pair.current += NOISE * Eigen::Vector2d(gaussian(rng), gaussian(rng));
    }
    const RelativePose found = refineRelativePose(problem.motion, noisy);
    const Eigen::AngleAxisd turn(problem.motion.rotation.transpose() * found.rotation);
    Eigen::Matrix<double, 6, 1> error;
    error << turn.angle() * turn.axis(), found.translation - problem.motion.translation;
    sum += error * error.transpose();
  }
  const Eigen::Matrix<double, 6, 6> measured = sum / DRAWS;
  const Eigen::Matrix<double, 6, 6> told = covarianceOf(problem.motion, problem.pairs, NOISE * NOISE);
  EXPECT_LT((measured - told).norm(), 0.25 * told.norm()) << measured << "\n" << told;
  EXPECT_LT((told * (Eigen::Matrix<double, 6, 1>() << 0.0, 0.0, 0.0, problem.motion.translation).finished()).norm(),
            1e-9);
}

TEST(Essential, RefinementFindsTheLeastError)
{
  const Problem problem(5, 100, 0.5 / 500.0);
  RelativePose start = problem.motion;
  start.rotation = start.rotation * Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitY()).toRotationMatrix();
  start.translation = (start.translation + Eigen::Vector3d(0.05, -0.05, 0.05)).normalized();
  const RelativePose found = refineRelativePose(start, problem.pairs);
  EXPECT_LT(problem.rotationError(found), 0.002);
  EXPECT_LT(problem.directionError(found), 0.01);
  const auto cost = [&](const RelativePose& pose) {
    double sum = 0.0;
    for (const Correspondence& pair : problem.pairs)
    {
      sum += sampsonError(pose.essential(), pair);
    }
    return sum;
  };
  EXPECT_LE(cost(found), cost(problem.motion));
  EXPECT_NEAR(found.translation.norm(), 1.0, 1e-9);
  EXPECT_EQ(refineRelativePose(start, {}).rotation, start.rotation);
}

TEST(RelativePoseEstimator, FindsTheMotionAmongOutliers)
{
  Problem problem(7, 100, 0.5 / 500.0);
  Rng rng(9);
  for (int i = 0; i < 100; ++i)
  {
    problem.pairs.push_back(
        { { uniform(rng, -0.6, 0.6), uniform(rng, -0.5, 0.5) }, { uniform(rng, -0.6, 0.6), uniform(rng, -0.5, 0.5) } });
  }
  RansacParams params;
  params.inlier_threshold = 2.0 / 500.0;
  params.sampling = Sampling::UNIFORM;
  const auto found = ransac(RelativePoseEstimator(problem.pairs), params, rng);
  ASSERT_TRUE(found.model);
  EXPECT_LT(problem.rotationError(found.model->pose), 0.004);
  EXPECT_LT(problem.directionError(found.model->pose), 0.03);
  EXPECT_GE(found.inliers.size(), 95u);
  EXPECT_LE(found.inliers.size(), 110u);
}

}  // namespace
}  // namespace view_servo
