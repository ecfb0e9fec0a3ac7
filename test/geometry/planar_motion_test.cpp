// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/planar_motion.h"

#include "support/level_cameras.h"
#include "support/synthetic_scene.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace view_servo
{
namespace
{
using test::depthOf;
using test::difference;
using test::levelCamera;
using test::onFloor;
using test::seenBy;

constexpr double FOCAL_LENGTH = 520.0;  // [px]

/** A reference camera and where it is in the current one, which stands anywhere. */
struct TwoCameras
{
  PlanarPose reference_in_current;
  Eigen::Isometry3d reference;  // world from optical frame
  Eigen::Isometry3d current;

  explicit TwoCameras(const PlanarPose& pose)
    : reference_in_current(pose),
      reference(onFloor({ 3.0, -1.0, 0.7 }) * levelCamera(pose)),
      current(onFloor({ 3.0, -1.0, 0.7 }) * levelCamera({}))
  {
  }

  Correspondence pairOf(const Eigen::Vector3d& point) const
  {
    return { seenBy(reference, point), seenBy(current, point) };
  }

  /** Well in front of both cameras and off the horizon, in the world. */
  Eigen::Vector3d randomPoint(Rng& rng) const
  {
    constexpr double NEAREST = 0.5;       // [m]
    constexpr double LEAST_HEIGHT = 0.1;  // off the horizon [m]
    while (true)
    {
      const double depth = uniform(rng, 1.5, 6.0);
      const double x = depth * uniform(rng, -0.7, 0.7);
      const double y = uniform(rng, -1.3, 1.0);
      const Eigen::Vector3d point = reference * Eigen::Vector3d(x, y, depth);
      if (std::abs(y) > LEAST_HEIGHT && depthOf(current, point) > NEAREST)
      {
        return point;
      }
    }
  }

  Correspondences randomPairs(Rng& rng, int count, double noise_px = 0.0) const
  {
    Correspondences pairs;
    for (int i = 0; i < count; ++i)
    {
      pairs.push_back(pairOf(randomPoint(rng)));
      for (Eigen::Vector2d* position : { &pairs.back().reference, &pairs.back().current })
      {
        position->x() += noise_px / FOCAL_LENGTH * gaussian(rng);
        position->y() += noise_px / FOCAL_LENGTH * gaussian(rng);
      }
    }
    return pairs;
  }
};

/** A motion of 0.3 to 1 m with some turn, seldom to the side. */
PlanarPose randomMotion(Rng& rng, bool behind)
{
  const double distance = uniform(rng, 0.3, 1.0);
  const double heading = uniform(rng, -1.2, 1.2) + (behind ? M_PI : 0.0);
  return { distance * std::cos(heading), distance * std::sin(heading), uniform(rng, -0.6, 0.6) };
}

/** Of two motions of unknown length. */
double directionDifference(const PlanarPose& a, const PlanarPose& b)
{
  return std::max(std::abs(wrapAngle(a.heading() - b.heading())), std::abs(wrapAngle(a.yaw - b.yaw)));
}

PlanarPose unitOf(const PlanarPose& pose)
{
  return { pose.x / pose.distance(), pose.y / pose.distance(), pose.yaw };
}

}  // namespace

// ---- two views

RC_GTEST_PROP(LevelMotion, IsThatOfThePoints, (std::uint64_t seed))
{
  Rng rng(seed);
  const TwoCameras cameras(randomMotion(rng, uniform(rng, 0.0, 1.0) < 0.5));
  const Eigen::Vector3d point = cameras.randomPoint(rng);
  const Eigen::Vector3d in_reference = cameras.reference.inverse() * point;
  const Eigen::Vector3d in_current =
      levelRotation(cameras.reference_in_current.yaw) * in_reference + levelTranslation(cameras.reference_in_current);
  RC_ASSERT((in_current - cameras.current.inverse() * point).norm() < 1e-9);
}

TEST(LevelMotion, SignsAreThoseOfRep103)
{
  // The reference is turned to the left: its axis points left in the current camera, where x is negative.
  EXPECT_NEAR((levelRotation(0.2) * Eigen::Vector3d::UnitZ()).x(), -std::sin(0.2), 1e-12);
  EXPECT_NEAR((levelRotation(0.2) * Eigen::Vector3d::UnitZ()).z(), std::cos(0.2), 1e-12);
  EXPECT_EQ(levelTranslation({ 2.0, 0.5, 0.3 }), Eigen::Vector3d(-0.5, 0.0, 2.0));
}

RC_GTEST_PROP(EssentialMatrix, VanishesForPairsOfOnePoint, (std::uint64_t seed))
{
  Rng rng(seed);
  const TwoCameras cameras(randomMotion(rng, uniform(rng, 0.0, 1.0) < 0.5));
  const Eigen::Matrix3d e = essentialMatrix(cameras.reference_in_current);
  const PlanarPose& pose = cameras.reference_in_current;
  RC_ASSERT(std::abs(e.norm() - std::sqrt(2.0)) < 1e-9);
  RC_ASSERT((e - essentialMatrix({ 3.0 * pose.x, 3.0 * pose.y, pose.yaw })).norm() < 1e-9);
  // Another motion does not do.
  const Eigen::Matrix3d other = essentialMatrix({ pose.x, pose.y, pose.yaw + 0.1 });
  double largest = 0.0;
  for (const Correspondence& pair : cameras.randomPairs(rng, 10))
  {
    const double scale = pair.current.homogeneous().norm() * pair.reference.homogeneous().norm();
    RC_ASSERT(std::abs(pair.current.homogeneous().dot(e * pair.reference.homogeneous())) < 1e-9 * scale);
    largest = std::max(largest, std::abs(pair.current.homogeneous().dot(other * pair.reference.homogeneous())));
  }
  RC_ASSERT(largest > 1e-4);
}

TEST(EssentialMatrix, EpipoleIsWhereTheReferenceCameraIs)
{
  for (const double heading : { -1.2, -0.3, 0.0, 0.4, 1.0, M_PI - 0.3 })
  {
    for (const double yaw : { -0.4, 0.0, 0.3 })
    {
      const Eigen::Matrix3d e = essentialMatrix({ 2.0 * std::cos(heading), 2.0 * std::sin(heading), yaw });
      // What is to the left has negative x.
      const Eigen::Vector3d epipole(-std::sin(heading), 0.0, std::cos(heading));
      EXPECT_LT((e.transpose() * epipole).norm(), 1e-12) << heading << ", " << yaw;
      // In the reference camera, the current one is on the other side, and turned the other way.
      const double back = heading + M_PI - yaw;
      EXPECT_LT((e * Eigen::Vector3d(-std::sin(back), 0.0, std::cos(back))).norm(), 1e-12) << heading << ", " << yaw;
    }
  }
}

TEST(EssentialMatrix, IsZeroWithoutMotion)
{
  EXPECT_EQ(essentialMatrix({ 0.0, 0.0, 0.3 }), Eigen::Matrix3d(Eigen::Matrix3d::Zero()));
}

// ---- the motion from two points

RC_GTEST_PROP(PlanarMotionFromTwoPoints, TheTruthIsAmongThem, (std::uint64_t seed, bool behind))
{
  Rng rng(seed);
  const TwoCameras cameras(randomMotion(rng, behind));
  const Correspondences pairs = cameras.randomPairs(rng, 2);
  const std::vector<PlanarPose> found = planarMotionFromTwoPoints(pairs[0], pairs[1]);
  RC_ASSERT(!found.empty() && found.size() <= 4U);
  double nearest = std::numeric_limits<double>::infinity();
  for (const PlanarPose& pose : found)
  {
    RC_ASSERT(std::abs(pose.distance() - 1.0) < 1e-9);
    for (const Correspondence& pair : pairs)
    {
      RC_ASSERT(inverseDepth(pair, pose).value > 0.0);
      RC_ASSERT(sampsonError(essentialMatrix(pose), pair) < 1e-10);
    }
    nearest = std::min(nearest, directionDifference(pose, cameras.reference_in_current));
  }
  RC_ASSERT(nearest < 1e-4);
}

TEST(PlanarMotionFromTwoPoints, TellsAheadFromBehind)
{
  Rng rng(1);
  for (const double heading : { M_PI, M_PI - 0.05, -M_PI + 0.1 })
  {
    const TwoCameras cameras({ 0.5 * std::cos(heading), 0.5 * std::sin(heading), 0.1 });
    int found = 0;
    for (int trial = 0; trial < 20; ++trial)
    {
      const Correspondences pairs = cameras.randomPairs(rng, 2);
      for (const PlanarPose& pose : planarMotionFromTwoPoints(pairs[0], pairs[1]))
      {
        found += directionDifference(pose, cameras.reference_in_current) < 1e-6 ? 1 : 0;
        // The same line, the other way.
        EXPECT_GT(directionDifference(pose, { -std::cos(heading), -std::sin(heading), 0.1 }), 1e-3);
      }
    }
    EXPECT_EQ(found, 20) << heading;
  }
}

TEST(PlanarMotionFromTwoPoints, PointsOnTheHorizonSayNothing)
{
  const Correspondence on_it{ { 0.2, 0.0 }, { 0.25, 0.0 } };
  const Correspondence too{ { -0.3, 0.0 }, { -0.35, 0.0 } };
  EXPECT_TRUE(planarMotionFromTwoPoints(on_it, too).empty());
  // One of them is not enough, either.
  const TwoCameras cameras({ 0.5, 0.1, 0.1 });
  Rng rng(2);
  const Correspondence off_it = cameras.pairOf(cameras.randomPoint(rng));
  EXPECT_TRUE(planarMotionFromTwoPoints(on_it, off_it).empty());
  EXPECT_TRUE(planarMotionFromTwoPoints(off_it, on_it).empty());
}

TEST(PlanarMotionFromTwoPoints, SomethingElseThanNumbersGivesNothing)
{
  const Correspondence good{ { 0.2, 0.3 }, { 0.25, 0.35 } };
  const Correspondence bad{ { 0.2, NOT_A_NUMBER }, { 0.25, 0.35 } };
  EXPECT_TRUE(planarMotionFromTwoPoints(good, bad).empty());
  EXPECT_TRUE(planarMotionFromTwoPoints(bad, good).empty());
}

// ---- depth

RC_GTEST_PROP(InverseDepth, IsExact, (std::uint64_t seed, bool behind))
{
  Rng rng(seed);
  const TwoCameras cameras(randomMotion(rng, behind));
  const Eigen::Vector3d point = cameras.randomPoint(rng);
  const Correspondence pair = cameras.pairOf(point);
  const PlanarPose& pose = cameras.reference_in_current;
  const double truth = 1.0 / depthOf(cameras.reference, point);
  const InverseDepth depth = inverseDepth(pair, pose);
  RC_ASSERT(std::abs(depth.value - truth) < 1e-6 * truth);
  // Its information is the squared speed of the point by the value.
  constexpr double STEP = 1e-5;
  const Eigen::Vector2d motion =
      project({ pair.reference, truth + STEP }, pose) - project({ pair.reference, truth - STEP }, pose);
  const double speed = motion.norm() / (2.0 * STEP);
  RC_ASSERT(std::abs(depth.information - speed * speed) < 1e-3 * speed * speed + 1e-9);
  // In units of twice the length all is half as far; by the general motion, too.
  const PlanarPose longer{ 2.0 * pose.x, 2.0 * pose.y, pose.yaw };
  RC_ASSERT(std::abs(inverseDepth(pair, longer).value - 0.5 * truth) < 1e-6 * truth);
  RC_ASSERT(inverseDepth(pair, levelRotation(pose.yaw), levelTranslation(pose)).value == depth.value);
}

TEST(InverseDepth, IsNegativeForTheWrongSense)
{
  Rng rng(3);
  for (int trial = 0; trial < 50; ++trial)
  {
    const TwoCameras cameras(randomMotion(rng, trial % 2 == 0));
    const PlanarPose& pose = cameras.reference_in_current;
    const Correspondence pair = cameras.pairOf(cameras.randomPoint(rng));
    EXPECT_LT(inverseDepth(pair, PlanarPose{ -pose.x, -pose.y, pose.yaw }).value, 0.0);
  }
}

TEST(InverseDepth, BehindTheCurrentCameraNothingIsKnown)
{
  // 1 m before the reference camera, and the current one has driven past it.
  const PlanarPose reference_in_current{ -2.0, 0.0, 0.0 };
  const Eigen::Vector3d in_current(0.2, 0.3, -1.0);
  const InverseDepth depth = inverseDepth({ { 0.2, 0.3 }, in_current.hnormalized() }, reference_in_current);
  EXPECT_LT(depth.value, 0.0);
  EXPECT_EQ(depth.information, 0.0);
}

TEST(InverseDepth, HasNoInformationWithoutABaseline)
{
  const InverseDepth still = inverseDepth({ { 0.2, 0.3 }, { 0.2, 0.3 } }, PlanarPose{ 0.0, 0.0, 0.0 });
  EXPECT_EQ(still.information, 0.0);
  EXPECT_EQ(still.value, 0.0);
  EXPECT_EQ(inverseDepth({ { 0.2, 0.3 }, { 0.3, 0.3 } }, PlanarPose{ 0.0, 0.0, 0.2 }).information, 0.0);
  // At the epipole, too.
  EXPECT_EQ(inverseDepth({ { 0.0, 0.0 }, { 0.0, 0.0 } }, PlanarPose{ 1.0, 0.0, 0.0 }).information, 0.0);
}

TEST(InverseDepth, FarAwayItIsZero)
{
  const Eigen::Vector3d direction(0.2, 0.3, 1.0);
  const PlanarPose pose{ 0.5, 0.3, 0.2 };
  const Correspondence pair{ direction.hnormalized(), (levelRotation(0.2) * direction).hnormalized() };
  EXPECT_NEAR(inverseDepth(pair, pose).value, 0.0, 1e-12);
  EXPECT_GT(inverseDepth(pair, pose).information, 0.0);
}

RC_GTEST_PROP(Project, IsWhereTheCameraSeesIt, (std::uint64_t seed, bool behind))
{
  Rng rng(seed);
  const TwoCameras cameras(randomMotion(rng, behind));
  const Eigen::Vector3d point = cameras.randomPoint(rng);
  const Landmark landmark{ seenBy(cameras.reference, point), 1.0 / depthOf(cameras.reference, point) };
  const Eigen::Vector2d expected = seenBy(cameras.current, point);
  RC_ASSERT((project(landmark, cameras.reference_in_current) - expected).norm() < 1e-9 * (1.0 + expected.norm()));
}

TEST(Project, IsNotANumberBehindTheCamera)
{
  const Landmark landmark{ { 0.1, 0.2 }, 1.0 };
  EXPECT_TRUE(project(landmark, { -0.9, 0.0, 0.0 }).allFinite());
  EXPECT_TRUE(project(landmark, { -1.1, 0.0, 0.0 }).array().isNaN().all());
  EXPECT_TRUE(project(landmark, { 0.0, 0.0, M_PI }).array().isNaN().all());
}

// ---- refinement

namespace
{
constexpr double WIDTH = 4.0 / FOCAL_LENGTH;

std::vector<Sighting> sightingsOf(const TwoCameras& cameras, int count, int outliers, double noise_px, Rng& rng)
{
  std::vector<Sighting> sightings;
  for (int i = 0; i < count; ++i)
  {
    const Eigen::Vector3d point = cameras.randomPoint(rng);
    Sighting sighting{ { seenBy(cameras.reference, point), 1.0 / depthOf(cameras.reference, point) },
                       seenBy(cameras.current, point) };
    sighting.current.x() += noise_px / FOCAL_LENGTH * gaussian(rng);
    sighting.current.y() += noise_px / FOCAL_LENGTH * gaussian(rng);
    if (i < outliers)
    {
      sighting.current.x() = uniform(rng, -0.6, 0.6);
      sighting.current.y() = uniform(rng, -0.45, 0.45);
    }
    sightings.push_back(sighting);
  }
  return sightings;
}

/** Tukey's biweight, as refinePlanarPose() promises it. */
double tukeyCostOf(const PlanarPose& pose, const std::vector<Sighting>& sightings)
{
  constexpr double LIMIT = 3.0 * WIDTH;
  double sum = 0.0;
  for (const Sighting& sighting : sightings)
  {
    const double ratio = (project(sighting.landmark, pose) - sighting.current).norm() / LIMIT;
    const double rest = ratio < 1.0 ? 1.0 - ratio * ratio : 0.0;
    sum += 1.0 - rest * rest * rest;
  }
  return sum;
}

double sampsonCostOf(const PlanarPose& pose, const Correspondences& pairs)
{
  double sum = 0.0;
  for (const Correspondence& pair : pairs)
  {
    sum += sampsonError(essentialMatrix(pose), pair);
  }
  return sum;
}

}  // namespace

TEST(RefinePlanarPose, FindsThePoseInSpiteOfNoiseAndOutliers)
{
  Rng rng(4);
  for (int trial = 0; trial < 20; ++trial)
  {
    const TwoCameras cameras(randomMotion(rng, trial % 2 == 0));
    const PlanarPose& truth = cameras.reference_in_current;
    const std::vector<Sighting> sightings = sightingsOf(cameras, 100, 30, 0.5, rng);
    const PlanarPose start{ truth.x + uniform(rng, -0.03, 0.03), truth.y + uniform(rng, -0.03, 0.03),
                            truth.yaw + uniform(rng, -0.01, 0.01) };
    const PlanarPose found = refinePlanarPose(start, sightings, WIDTH);
    EXPECT_LT(std::hypot(found.x - truth.x, found.y - truth.y), 0.004) << trial;
    EXPECT_LT(std::abs(found.yaw - truth.yaw), 0.002) << trial;
    // A minimum: each step in any direction costs.
    const double least = tukeyCostOf(found, sightings);
    for (const double step : { -1e-4, 1e-4 })
    {
      EXPECT_LT(least, tukeyCostOf({ found.x + step, found.y, found.yaw }, sightings)) << trial;
      EXPECT_LT(least, tukeyCostOf({ found.x, found.y + step, found.yaw }, sightings)) << trial;
      EXPECT_LT(least, tukeyCostOf({ found.x, found.y, found.yaw + step }, sightings)) << trial;
    }
  }
}

TEST(RefinePlanarPose, IsExactOnExactData)
{
  Rng rng(5);
  const TwoCameras cameras({ -0.4, 0.2, -0.1 });
  const PlanarPose& truth = cameras.reference_in_current;
  const std::vector<Sighting> sightings = sightingsOf(cameras, 30, 0, 0.0, rng);
  const PlanarPose found =
      refinePlanarPose({ truth.x + 0.01, truth.y - 0.01, truth.yaw + 0.005 + 2.0 * M_PI }, sightings, WIDTH);
  EXPECT_LT(difference(found, truth), 1e-8);
  EXPECT_NEAR(found.yaw, truth.yaw, 1e-8);  // wrapped
}

TEST(RefinePlanarPose, LeavesOutWhatIsNoNumber)
{
  Rng rng(5);
  const TwoCameras cameras({ -0.4, 0.2, -0.1 });
  const PlanarPose& truth = cameras.reference_in_current;
  std::vector<Sighting> sightings = sightingsOf(cameras, 30, 0, 0.0, rng);
  sightings[3].current.x() = NOT_A_NUMBER;
  sightings[7].landmark.inverse_depth = NOT_A_NUMBER;
  sightings[9].landmark.inverse_depth = std::numeric_limits<double>::infinity();
  const PlanarPose found = refinePlanarPose({ truth.x + 0.01, truth.y - 0.01, truth.yaw + 0.005 }, sightings, WIDTH);
  EXPECT_LT(difference(found, truth), 1e-8);
}

TEST(RefinePlanarPose, WhatDoesNotDetermineItLeavesItAsItWas)
{
  const PlanarPose initial{ 0.5, 0.1, 0.2 };
  EXPECT_EQ(difference(refinePlanarPose(initial, {}, WIDTH), initial), 0.0);
  // All are false: further away than thrice the width.
  Rng rng(6);
  std::vector<Sighting> false_ones = sightingsOf(TwoCameras(initial), 20, 0, 0.0, rng);
  for (Sighting& sighting : false_ones)
  {
    sighting.current.x() += 3.1 * WIDTH;
  }
  EXPECT_EQ(difference(refinePlanarPose(initial, false_ones, WIDTH), initial), 0.0);
  // All behind the camera.
  EXPECT_EQ(difference(refinePlanarPose({ -9.0, 0.0, 0.0 }, false_ones, WIDTH), { -9.0, 0.0, 0.0 }), 0.0);
}

TEST(RefinePlanarPose, OneSightingLeavesItAsItWas)
{
  // It has two coordinates for three unknowns.
  const PlanarPose initial{ 0.5, 0.1, 0.2 };
  Sighting one{ { { 0.1, 0.3 }, 0.5 }, project({ { 0.1, 0.3 }, 0.5 }, initial) };
  one.current += Eigen::Vector2d(0.003, -0.002);
  EXPECT_EQ(difference(refinePlanarPose(initial, { one }, WIDTH), initial), 0.0);
}

TEST(RefinePlanarMotion, FindsTheMinimumOfTheSampsonDistances)
{
  Rng rng(7);
  for (int trial = 0; trial < 20; ++trial)
  {
    const TwoCameras cameras(randomMotion(rng, trial % 2 == 0));
    const PlanarPose& truth = cameras.reference_in_current;
    const Correspondences pairs = cameras.randomPairs(rng, 100, 0.5);
    const double heading = truth.heading() + uniform(rng, -0.15, 0.15);
    const PlanarPose start{ 2.0 * std::cos(heading), 2.0 * std::sin(heading), truth.yaw + uniform(rng, -0.05, 0.05) };
    const PlanarPose found = refinePlanarMotion(start, pairs);
    EXPECT_NEAR(found.distance(), 1.0, 1e-12);
    EXPECT_LT(std::abs(wrapAngle(found.heading() - truth.heading())), 1.0 * DEGREE) << trial;
    EXPECT_LT(std::abs(wrapAngle(found.yaw - truth.yaw)), 0.2 * DEGREE) << trial;
    const double least = sampsonCostOf(found, pairs);
    for (const double step : { -1e-4, 1e-4 })
    {
      const double turned = found.heading() + step;
      EXPECT_LT(least, sampsonCostOf({ std::cos(turned), std::sin(turned), found.yaw }, pairs)) << trial;
      EXPECT_LT(least, sampsonCostOf({ found.x, found.y, found.yaw + step }, pairs)) << trial;
    }
  }
}

TEST(RefinePlanarMotion, IsExactOnExactData)
{
  Rng rng(8);
  const TwoCameras cameras({ 0.6, -0.3, 0.2 });
  const PlanarPose found = refinePlanarMotion({ 0.6, -0.2, 0.23 }, cameras.randomPairs(rng, 30), 20);
  EXPECT_LT(directionDifference(found, cameras.reference_in_current), 1e-8);
}

TEST(RefinePlanarMotion, NothingToGoByLeavesItAsItWas)
{
  const PlanarPose initial{ 0.6, -0.3, 0.2 };
  EXPECT_LT(difference(refinePlanarMotion(initial, {}), unitOf(initial)), 1e-12);
  Rng rng(9);
  const Correspondences pairs = TwoCameras(initial).randomPairs(rng, 10, 2.0);
  EXPECT_LT(difference(refinePlanarMotion(initial, pairs, 0), unitOf(initial)), 1e-12);
  // A point that is the epipole in both views.
  EXPECT_LT(difference(refinePlanarMotion({ 1.0, 0.0, 0.0 }, { { { 0.0, 0.0 }, { 0.0, 0.0 } } }), { 1.0, 0.0, 0.0 }),
            1e-12);
}

}  // namespace view_servo
