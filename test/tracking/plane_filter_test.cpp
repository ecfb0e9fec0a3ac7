// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_filter.h"

#include "support/camera_pose_error.h"
#include "support/cameras.h"
#include "support/synthetic_scene.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
const Eigen::Matrix3d FILTERED_K = test::cameraMatrix(600.0, 600.0, 320.0, 240.0);

/** A camera that moves before a plane, with the homographies that noisy points give. */
class Approach
{
public:
  explicit Approach(std::uint64_t seed) : rng_(seed)
  {
    normal_ = test::randomRotation(rng_, 0.2) * Eigen::Vector3d::UnitZ();
    reference_in_odom_ = Eigen::Translation3d(0.4, -0.2, 0.3) * Eigen::Quaterniond(test::randomRotation(rng_, 0.5));
    const double bearing = uniform(rng_, 0.0, 2.0 * M_PI);
    start_ = Eigen::Vector3d(0.3 * std::cos(bearing), 0.3 * std::sin(bearing), uniform(rng_, -0.2, 0.0));
    turn_ = test::randomRotation(rng_, 0.08);
    for (int i = 0; i < 60; ++i)
    {
      const double u = uniform(rng_, 120.0, 520.0);
      points_.push_back({ u, uniform(rng_, 80.0, 400.0) });
    }
  }

  const Eigen::Vector3d& normal() const
  {
    return normal_;
  }

  /** In the reference camera's frame; from the start at 0 to the reference at 1. */
  Eigen::Isometry3d camera(double part) const
  {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = (1.0 - part) * start_;
    pose.linear() = Eigen::Quaterniond(turn_).slerp(part, Eigen::Quaterniond::Identity()).toRotationMatrix();
    return pose;
  }
  Eigen::Isometry3d cameraInOdom(double part) const
  {
    return reference_in_odom_ * camera(part);
  }

  EuclideanHomography truth(double part) const
  {
    const Eigen::Isometry3d motion = camera(part).inverse();
    return { motion.linear(), motion.translation() / DISTANCE, normal_ };
  }

  Eigen::Matrix3d measure(double part, double noise)
  {
    const Eigen::Matrix3d h = FILTERED_K * truth(part).matrix() * FILTERED_K.inverse();
    Correspondences pairs;
    for (const Eigen::Vector2d& point : points_)
    {
      Eigen::Vector2d current = transfer(h, point);
      current.x() += noise * gaussian(rng_);
      current.y() += noise * gaussian(rng_);
      pairs.push_back({ point, current });
    }
    const auto linear = homographyFromPoints(pairs);
    return refineHomography(*linear, pairs);
  }

  void addTo(PlaneFilter& filter, double part, double noise)
  {
    filter.add(cameraInOdom(part), measure(part, noise), FILTERED_K, points_);
  }
  const Points& points() const
  {
    return points_;
  }

  static constexpr double DISTANCE = 0.7;  // [m]

private:
  Rng rng_;
  Eigen::Vector3d normal_;
  Eigen::Isometry3d reference_in_odom_;
  Eigen::Vector3d start_;
  Eigen::Matrix3d turn_;
  Points points_;
};

double rotationError(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle();
}

}  // namespace

TEST(PlaneFilterParams, NameAllFaultsAtOnce)
{
  PlaneFilterParams params;
  EXPECT_TRUE(params.validate().empty());
  params.window = 0.0;
  params.max_measurements = 1;
  params.decision = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 3U);
  EXPECT_THROW(PlaneFilter{ params }, std::invalid_argument);
}

TEST(PlaneFilter, KnowsNothingAtFirst)
{
  PlaneFilter filter{ PlaneFilterParams() };
  EXPECT_FALSE(filter.estimate());
  const Points seen{ { 200.0, 200.0 }, { 400.0, 300.0 } };
  const Eigen::Matrix3d mirror = Eigen::Vector3d(-1.0, 1.0, 1.0).asDiagonal();
  filter.add(Eigen::Isometry3d::Identity(), mirror, FILTERED_K, seen);
  EXPECT_FALSE(filter.estimate());
  // A camera that has only turned tells its rotation, but no plane.
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.6, 0.0, 0.8)).toRotationMatrix();
  filter.add(Eigen::Isometry3d::Identity(), FILTERED_K * turn * FILTERED_K.inverse(), FILTERED_K, seen);
  ASSERT_TRUE(filter.estimate());
  EXPECT_FALSE(filter.estimate()->normal_known);
  EXPECT_FALSE(filter.estimate()->distance);
  EXPECT_LT(rotationError(filter.estimate()->motion.rotation, turn), 1e-9);
  EXPECT_LT(filter.estimate()->motion.translation_over_distance.norm(), 1e-9);
}

TEST(PlaneFilter, FindsPlaneDistanceAndMotionOnTheWay)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    Approach approach(seed);
    PlaneFilter filter{ PlaneFilterParams() };
    constexpr int STEPS = 80;
    double raw = 0.0;
    double filtered = 0.0;
    for (int i = 0; i <= STEPS; ++i)
    {
      const double part = 0.9 * i / STEPS;
      const Eigen::Matrix3d h = approach.measure(part, 0.3);
      filter.add(approach.cameraInOdom(part), h, FILTERED_K, approach.points());
      const auto estimate = filter.estimate();
      ASSERT_TRUE(estimate) << seed;
      if (!estimate->ambiguous)
      {
        EXPECT_GT(estimate->motion.normal.dot(approach.normal()), std::cos(8.0 * DEGREE)) << seed << ", " << i;
      }
      if (i >= STEPS / 2)
      {
        ASSERT_TRUE(estimate->distance) << seed << ", " << i;
        EXPECT_FALSE(estimate->ambiguous) << seed << ", " << i;
        EXPECT_NEAR(*estimate->distance, Approach::DISTANCE, 0.05 * Approach::DISTANCE) << seed << ", " << i;
        EXPECT_GT(estimate->motion.normal.dot(approach.normal()), std::cos(3.0 * DEGREE)) << seed << ", " << i;
        const EuclideanHomography truth = approach.truth(part);
        double best = 1e9;
        for (const EuclideanHomography& solution : decomposeHomography(h, FILTERED_K, approach.points()))
        {
          best = std::min(best, rotationError(solution.rotation, truth.rotation));
        }
        raw += best;
        filtered += rotationError(estimate->motion.rotation, truth.rotation);
        EXPECT_LT((estimate->motion.translation_over_distance - truth.translation_over_distance).norm(), 0.02) << seed;
      }
    }
    EXPECT_LT(filtered, raw) << seed;
  }
}

TEST(PlaneFilter, KnowsHowExactTheCamerasPoseIs)
{
  constexpr int RUNS = 40;
  constexpr double NOISE = 0.3;  // of each coordinate [px]
  for (const double until : { 0.5, 0.75, 1.0 })
  {
    double normalised = 0.0;
    int known = 0;
    for (std::uint64_t seed = 1; seed <= RUNS; ++seed)
    {
      Approach approach(seed);
      PlaneFilter filter{ PlaneFilterParams() };
      EXPECT_FALSE(filter.cameraPose(FILTERED_K, approach.points(), NOISE));
      for (int i = 0; i <= 80; ++i)
      {
        approach.addTo(filter, until * i / 80.0, NOISE);
      }
      const auto pose = filter.cameraPose(FILTERED_K, approach.points(), std::sqrt(2.0) * NOISE);
      if (!pose)
      {
        continue;
      }
      ++known;
      normalised += test::normalisedError(*pose, approach.camera(until));
    }
    EXPECT_GE(known, RUNS * 3 / 4) << until;
    EXPECT_LT(normalised / known, 4.0) << until;
    EXPECT_GT(normalised / known, 0.25) << until;
  }
}

TEST(PlaneFilter, TellsNoDistanceBeforeTheCameraHasMovedEnough)
{
  Approach approach(3);
  PlaneFilter filter{ PlaneFilterParams() };
  for (int i = 0; i < 40; ++i)
  {
    approach.addTo(filter, 0.2, 0.3);
    ASSERT_TRUE(filter.estimate());
    EXPECT_FALSE(filter.estimate()->distance);
  }
}

TEST(PlaneFilter, TellsTheDistanceEarlyWhereImagesAreExact)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    Approach approach(seed);
    PlaneFilter filter{ PlaneFilterParams() };
    const Eigen::Vector3d first = approach.cameraInOdom(0.6).translation();
    double part = 0.6;
    while ((approach.cameraInOdom(part).translation() - first).norm() < 0.5 * PlaneFilterParams().window)
    {
      part += 0.002;
      approach.addTo(filter, part, 0.15);
    }
    const std::optional<double> distance = filter.estimate()->distance;
    ASSERT_TRUE(distance) << seed;
    EXPECT_NEAR(*distance, Approach::DISTANCE, 0.08 * Approach::DISTANCE) << seed;
  }
}

TEST(PlaneFilter, KeepsItsPlaneWhereTheViewsAgree)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    Approach approach(seed);
    PlaneFilter filter{ PlaneFilterParams() };
    for (int i = 0; i <= 80; ++i)
    {
      approach.addTo(filter, i / 80.0, 0.1);
    }
    for (int i = 0; i < 100; ++i)
    {
      approach.addTo(filter, 1.0, 0.1);  // no decomposition tells anything here
    }
    const auto estimate = filter.estimate();
    ASSERT_TRUE(estimate && estimate->distance) << seed;
    EXPECT_NEAR(*estimate->distance, Approach::DISTANCE, 0.03 * Approach::DISTANCE) << seed;
    EXPECT_GT(estimate->motion.normal.dot(approach.normal()), std::cos(2.0 * DEGREE)) << seed;
    EXPECT_LT(rotationError(estimate->motion.rotation, Eigen::Matrix3d::Identity()), 0.05 * DEGREE) << seed;
    EXPECT_LT(estimate->motion.translation_over_distance.norm(), 1e-3) << seed;
  }
}

TEST(PlaneFilter, DoesWithoutOdometry)
{
  Approach approach(4);
  PlaneFilter filter{ PlaneFilterParams() };
  for (int i = 0; i <= 60; ++i)
  {
    const double part = i / 80.0;
    filter.add(std::nullopt, approach.measure(part, 0.2), FILTERED_K, approach.points());
  }
  const auto estimate = filter.estimate();
  ASSERT_TRUE(estimate);
  EXPECT_FALSE(estimate->distance);
  EXPECT_GT(estimate->motion.normal.dot(approach.normal()), std::cos(3.0 * DEGREE));
  EXPECT_LT(rotationError(estimate->motion.rotation, approach.truth(0.75).rotation), 0.3 * DEGREE);
}

double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return Eigen::AngleAxisd(a.transpose() * b).angle();
}

// A picture of the view is held before the camera: to average it with what was seen before says that the camera turns.
TEST(PlaneFilter, BeginsAnewWhenSomethingElseIsSeen)
{
  Approach approach(3);
  PlaneFilter filter{ PlaneFilterParams() };
  for (int i = 0; i <= 30; ++i)
  {
    approach.addTo(filter, 0.01 * i, 0.3);
  }
  for (int i = 1; i <= 10; ++i)
  {
    filter.add(approach.cameraInOdom(0.3 + 0.01 * i), approach.measure(1.0, 0.3), FILTERED_K, approach.points());
    EXPECT_LT(angleBetween(filter.estimate()->motion.rotation, Eigen::Matrix3d::Identity()), 0.9 * DEGREE) << i;
    EXPECT_LT(filter.estimate()->motion.translation_over_distance.norm(), 0.01) << i;
  }
}

// One image comes without odometry, and when it is there again it counts from elsewhere.
TEST(PlaneFilter, ForgetsOdometryThatHasBegunAnew)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    Approach approach(seed);
    PlaneFilter filter{ PlaneFilterParams() };
    const Eigen::Isometry3d elsewhere(Eigen::Translation3d(3.0, -1.0, 0.5));
    for (int i = 0; i <= 80; ++i)
    {
      const double part = 0.01 * i;
      const Eigen::Matrix3d h = approach.measure(part, 0.3);
      if (i == 40)
      {
        filter.add(std::nullopt, h, FILTERED_K, approach.points());
        continue;
      }
      const Eigen::Isometry3d camera = approach.cameraInOdom(part);
      filter.add(i < 40 ? camera : elsewhere * camera, h, FILTERED_K, approach.points());
      if (filter.estimate()->distance)
      {
        EXPECT_NEAR(*filter.estimate()->distance, Approach::DISTANCE, 0.15 * Approach::DISTANCE) << seed << ", " << i;
      }
    }
    EXPECT_TRUE(filter.estimate()->distance) << seed;
  }
}

// So near to the view noise makes the normal, and what it was taken for first is far from what it is.
TEST(PlaneFilter, GivesUpANormalThatNothingAgreesWithLater)
{
  Approach approach(5);
  PlaneFilter filter{ PlaneFilterParams() };
  const Eigen::Vector3d wrong = Eigen::AngleAxisd(60.0 * DEGREE, Eigen::Vector3d::UnitX()) * approach.normal();
  EuclideanHomography motion = approach.truth(0.9);
  motion.translation_over_distance = Eigen::Vector3d(0.0, 0.0, 0.035);
  motion.normal = wrong;
  filter.add(approach.cameraInOdom(0.9), FILTERED_K * motion.matrix() * FILTERED_K.inverse(), FILTERED_K,
             approach.points());
  for (int i = 0; i <= 80; ++i)
  {
    approach.addTo(filter, 0.85 - 0.01 * i, 0.3);
  }
  EXPECT_GT(filter.estimate()->motion.normal.dot(approach.normal()), std::cos(5.0 * DEGREE));
}

TEST(PlaneFilter, LeavesOutASingleMeasurementThatContradictsTheOthers)
{
  Approach approach(4);
  PlaneFilter filter{ PlaneFilterParams() };
  PlaneFilter undisturbed{ PlaneFilterParams() };
  for (int i = 0; i <= 60; ++i)
  {
    const Eigen::Matrix3d h = approach.measure(0.01 * i, 0.3);
    if (i % 10 == 9)
    {
      filter.add(approach.cameraInOdom(0.01 * i), approach.measure(1.0, 0.3), FILTERED_K, approach.points());
    }
    filter.add(approach.cameraInOdom(0.01 * i), h, FILTERED_K, approach.points());
    undisturbed.add(approach.cameraInOdom(0.01 * i), h, FILTERED_K, approach.points());
    if (i > 20)
    {
      EXPECT_LT(angleBetween(filter.estimate()->motion.rotation, undisturbed.estimate()->motion.rotation), 1e-6) << i;
      EXPECT_EQ(filter.estimate()->distance.has_value(), undisturbed.estimate()->distance.has_value()) << i;
    }
  }
}

TEST(PlaneFilter, StaysAmbiguousWhereNothingTells)
{
  // Two decompositions at one place: their normals do not move.
  int ambiguous = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    Approach approach(seed);
    if (decomposeHomography(approach.measure(0.1, 0.0), FILTERED_K, approach.points()).size() != 2U)
    {
      continue;
    }
    PlaneFilter filter{ PlaneFilterParams() };
    for (int i = 0; i < 30; ++i)
    {
      approach.addTo(filter, 0.1, 0.02);
    }
    ++ambiguous;
    EXPECT_TRUE(filter.estimate()->ambiguous) << seed;
  }
  EXPECT_GT(ambiguous, 0);
}

}  // namespace view_servo
