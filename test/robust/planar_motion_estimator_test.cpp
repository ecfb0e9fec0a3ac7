// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/planar_motion_estimator.h"

#include "support/level_matches.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/significance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace view_servo
{
namespace
{
using test::FOCAL_LENGTH;
using test::inImage;
using test::noisy;
using test::randomPosition;

constexpr double THRESHOLD = 2.0 / FOCAL_LENGTH;  // of inliers
constexpr double MAX_YAW = 0.6;                   // [rad]
constexpr double BY_CHANCE = 2.2 * THRESHOLD;     // about the part of an image within THRESHOLD of a line through it
constexpr int SAMPLE_SIZE = PlanarMotionEstimator::SAMPLE_SIZE;

/** The current point of a reference point at a depth, exact; NaN when it is not in the image. */
Eigen::Vector2d moved(const Eigen::Vector2d& reference, double depth, const PlanarPose& reference_in_current)
{
  const Eigen::Vector3d in_current = test::inCurrentCamera(depth * reference.homogeneous(), reference_in_current);
  const Eigen::Vector2d current = in_current.hnormalized();
  return in_current.z() > 0.2 && inImage(current) ? current : Eigen::Vector2d::Constant(NOT_A_NUMBER);
}

/** Sightings of points 1.5 to 6 m away, noisy in the current image; then unrelated ones. */
std::vector<Sighting> sightingsOf(const PlanarPose& truth, int inliers, int outliers, Rng& rng)
{
  std::vector<Sighting> sightings;
  while (static_cast<int>(sightings.size()) < inliers)
  {
    const Eigen::Vector2d reference = randomPosition(rng);
    const double depth = uniform(rng, 1.5, 6.0);
    const Eigen::Vector2d current = moved(reference, depth, truth);
    if (current.allFinite())
    {
      sightings.push_back({ { reference, 1.0 / depth }, noisy(current, rng) });
    }
  }
  for (int i = 0; i < outliers; ++i)
  {
    const Eigen::Vector2d reference = randomPosition(rng);
    const double depth = uniform(rng, 1.5, 6.0);
    sightings.push_back({ { reference, 1.0 / depth }, randomPosition(rng) });
  }
  return sightings;
}

/** The same without depths, noisy in both images. */
Correspondences pairsOf(const PlanarPose& truth, int inliers, int outliers, Rng& rng)
{
  Correspondences pairs;
  for (const Sighting& sighting : sightingsOf(truth, inliers, outliers, rng))
  {
    pairs.push_back({ noisy(sighting.landmark.reference, rng), sighting.current });
  }
  return pairs;
}

RansacParams params()
{
  RansacParams result;
  result.inlier_threshold = THRESHOLD;
  result.sampling = Sampling::UNIFORM;
  return result;
}

RansacResult<PlanarMotion> findMotion(const Correspondences& pairs, std::uint64_t seed)
{
  Rng rng(seed);
  return ransac(PlanarMotionEstimator(pairs, MAX_YAW), params(), rng);
}

/** Of the motion that is found. */
double significanceOf(const Correspondences& pairs, std::uint64_t seed)
{
  return logSignificance(pairs.size(), findMotion(pairs, seed).inliers.size(), SAMPLE_SIZE, BY_CHANCE);
}

double among(const Correspondences& support, const PlanarMotion& motion)
{
  return chanceAmong(support.size(), [&](std::size_t reference, std::size_t current) {
    return sampsonError(motion.essential, { support[reference].reference, support[current].current }) <=
           THRESHOLD * THRESHOLD;
  });
}

const std::vector<PlanarPose>& truths()
{
  static const std::vector<PlanarPose> all{
    { 0.9, 0.4, 0.0 },    // ahead, to the left
    { 0.8, -0.5, 0.09 },  // ahead, to the right
    { -0.6, 0.1, -0.3 },  // behind
    { 0.3, 0.5, 0.2 },    // mostly to the left
  };
  return all;
}

}  // namespace

// ---- the motion from matches

TEST(PlanarMotionEstimator, FindsTheMotionAmongFalseMatches)
{
  for (const double outlier_ratio : { 0.5, 0.7 })
  {
    for (const PlanarPose& truth : truths())
    {
      for (std::uint64_t seed = 1; seed <= 3; ++seed)
      {
        Rng rng(100 + seed);
        const int outliers = static_cast<int>(std::lround(240 * outlier_ratio));
        const Correspondences pairs = pairsOf(truth, 240 - outliers, outliers, rng);
        const auto result = findMotion(pairs, seed);
        ASSERT_TRUE(result.model.has_value());
        const PlanarPose& pose = result.model->pose;
        EXPECT_LT(std::abs(wrapAngle(pose.heading() - truth.heading())), 1.5 * DEGREE)
            << truth.heading() << ", " << outlier_ratio;
        EXPECT_LT(std::abs(wrapAngle(pose.yaw - truth.yaw)), 0.5 * DEGREE) << truth.heading() << ", " << outlier_ratio;
        EXPECT_NEAR(pose.distance(), 1.0, 1e-9);
        // Nearly all true ones, and the few false ones that happen to agree.
        const auto first_false = std::lower_bound(result.inliers.begin(), result.inliers.end(), 240 - outliers);
        EXPECT_GT(first_false - result.inliers.begin(), 0.95 * (240 - outliers));
        EXPECT_LT(result.inliers.end() - first_false, 0.1 * outliers);
      }
    }
  }
}

TEST(PlanarMotionEstimator, MembersOfItsModelAgree)
{
  const PlanarPose pose{ std::cos(0.4), std::sin(0.4), 0.2 };
  const PlanarMotion motion(pose);
  EXPECT_TRUE(motion.rotation.isApprox(levelRotation(0.2)));
  EXPECT_TRUE(motion.translation.isApprox(levelTranslation(pose)));
  EXPECT_TRUE(motion.essential.isApprox(essentialMatrix(pose)));
}

TEST(PlanarMotionEstimator, ErrorIsTheSampsonDistanceInFrontOfTheCameras)
{
  const PlanarPose pose{ 1.0, 0.0, 0.0 };
  const Eigen::Vector2d reference(0.2, 0.3);
  Eigen::Vector2d current = moved(reference, 2.0, pose);
  current.x() += 0.01;
  const Correspondences pairs{ { reference, current }, { current, reference }, { { 0.3, 0.2 }, { 0.3, 0.2 } } };
  const PlanarMotionEstimator estimator(pairs, MAX_YAW);
  EXPECT_EQ(estimator.size(), 3U);
  EXPECT_GT(estimator.error(PlanarMotion(pose), 0), 0.0);
  EXPECT_EQ(estimator.error(PlanarMotion(pose), 0), sampsonError(essentialMatrix(pose), pairs[0]));
  // What comes nearer while the camera drives backwards is behind it, though it meets the epipolar constraint.
  EXPECT_LT(sampsonError(essentialMatrix(pose), pairs[1]), 1e-3);
  EXPECT_TRUE(std::isinf(estimator.error(PlanarMotion(pose), 1)));
  // What stays where it is may be far away.
  EXPECT_LT(estimator.error(PlanarMotion(pose), 2), 1e-12);
}

TEST(PlanarMotionEstimator, RefusesSamplesOfTheHorizon)
{
  const Correspondences pairs{ { { 0.1, 0.2 }, { 0.1, 0.2 } },
                               { { 0.2, 0.005 }, { 0.2, -0.005 } },
                               { { 0.3, -0.3 }, { 0.3, -0.3 } } };
  const PlanarMotionEstimator estimator(pairs, MAX_YAW);
  EXPECT_TRUE(estimator.accepts({ 0, 2 }));
  EXPECT_FALSE(estimator.accepts({ 0, 1 }));
  EXPECT_FALSE(estimator.accepts({ 1, 2 }));
}

TEST(PlanarMotionEstimator, LooksForNoLargerTurns)
{
  Rng rng(1);
  const PlanarPose truth{ 0.8, 0.3, 0.3 };
  const Correspondences pairs = pairsOf(truth, 100, 0, rng);
  const PlanarMotionEstimator narrow(pairs, 0.2);
  std::vector<PlanarMotion> models;
  for (int i = 0; i + 1 < 100; i += 2)
  {
    narrow.solve({ i, i + 1 }, models);
  }
  EXPECT_TRUE(std::all_of(models.begin(), models.end(),
                          [](const PlanarMotion& model) { return std::abs(model.pose.yaw) <= 0.2; }));
  std::vector<int> all;
  for (int i = 0; i < 100; ++i)
  {
    all.push_back(i);
  }
  EXPECT_FALSE(narrow.refit(PlanarMotion({ 0.9, 0.3, 0.19 }), all).has_value());
  EXPECT_TRUE(PlanarMotionEstimator(pairs, MAX_YAW).refit(PlanarMotion({ 0.9, 0.3, 0.19 }), all).has_value());
}

TEST(PlanarMotionEstimator, SameSeedSameResult)
{
  Rng rng(2);
  const Correspondences pairs = pairsOf(truths()[0], 80, 120, rng);
  const auto first = findMotion(pairs, 5);
  const auto second = findMotion(pairs, 5);
  ASSERT_TRUE(first.model && second.model);
  EXPECT_EQ(first.inliers, second.inliers);
  EXPECT_EQ(first.cost, second.cost);
  EXPECT_EQ(first.model->essential, second.model->essential);
  EXPECT_EQ(first.statistics.iterations, second.statistics.iterations);
}

TEST(PlanarMotionEstimator, TooFewMatchesGiveNothing)
{
  Rng rng(3);
  EXPECT_FALSE(findMotion({}, 1).model.has_value());
  EXPECT_FALSE(findMotion(pairsOf(truths()[0], 1, 0, rng), 1).model.has_value());
  // Any number on the horizon are too few.
  Correspondences horizon;
  for (int i = 0; i < 50; ++i)
  {
    horizon.push_back({ { 0.01 * i, 0.0 }, { 0.011 * i, 0.0 } });
  }
  EXPECT_FALSE(findMotion(horizon, 1).model.has_value());
}

// ---- the pose from sightings

TEST(PlanarPoseEstimator, FindsThePoseAmongFalseSightings)
{
  for (const double outlier_ratio : { 0.5, 0.7 })
  {
    for (const PlanarPose& truth : truths())
    {
      Rng rng(7);
      const int outliers = static_cast<int>(std::lround(200 * outlier_ratio));
      const std::vector<Sighting> sightings = sightingsOf(truth, 200 - outliers, outliers, rng);
      Rng draws(1);
      const auto result = ransac(PlanarPoseEstimator(sightings, THRESHOLD), params(), draws);
      ASSERT_TRUE(result.model.has_value());
      EXPECT_LT(std::hypot(result.model->x - truth.x, result.model->y - truth.y), 0.008) << truth.heading();
      EXPECT_LT(std::abs(result.model->yaw - truth.yaw), 0.2 * DEGREE) << truth.heading();
      EXPECT_GT(static_cast<double>(result.inliers.size()), 0.95 * (200 - outliers));
      Rng again(1);
      const auto second = ransac(PlanarPoseEstimator(sightings, THRESHOLD), params(), again);
      ASSERT_TRUE(second.model.has_value());
      EXPECT_EQ(second.inliers, result.inliers);
      EXPECT_EQ(second.model->x, result.model->x);
      EXPECT_EQ(second.model->yaw, result.model->yaw);
    }
  }
}

TEST(PlanarPoseEstimator, TwoExactSightingsGiveThePose)
{
  Rng rng(8);
  int compared = 0;
  for (const PlanarPose& truth : truths())
  {
    for (int trial = 0; trial < 20; ++trial)
    {
      std::vector<Sighting> two = sightingsOf(truth, 2, 0, rng);
      for (Sighting& sighting : two)
      {
        sighting.current = moved(sighting.landmark.reference, 1.0 / sighting.landmark.inverse_depth, truth);
      }
      if (!two[0].current.allFinite() || !two[1].current.allFinite())
      {
        continue;  // the noise had brought it into the image
      }
      ++compared;
      const PlanarPoseEstimator estimator(two, THRESHOLD);
      std::vector<PlanarPose> poses;
      estimator.solve({ 0, 1 }, poses);
      ASSERT_EQ(poses.size(), 1U);
      EXPECT_LT(std::hypot(poses[0].x - truth.x, poses[0].y - truth.y), 1e-8);
      EXPECT_NEAR(poses[0].yaw, truth.yaw, 1e-8);
      EXPECT_LT(estimator.error(poses[0], 0), 1e-16);
      EXPECT_LT(estimator.error(poses[0], 1), 1e-16);
    }
  }
  EXPECT_GT(compared, 70);
}

TEST(PlanarPoseEstimator, AmbiguousAndImpossibleSightingsGiveNothing)
{
  const Sighting one{ { { 0.1, 0.2 }, 0.5 }, { 0.12, 0.22 } };
  std::vector<PlanarPose> poses;
  const std::vector<Sighting> twice{ one, one };
  PlanarPoseEstimator(twice, THRESHOLD).solve({ 0, 1 }, poses);
  EXPECT_TRUE(poses.empty());
  // The horizon that has moved to below it: no motion on the floor does that.
  const std::vector<Sighting> impossible{ { { { 0.1, 0.2 }, 0.5 }, { 0.12, 0.22 } },
                                          { { { -0.3, 0.1 }, 0.3 }, { -0.31, -0.4 } } };
  PlanarPoseEstimator(impossible, THRESHOLD).solve({ 0, 1 }, poses);
  EXPECT_TRUE(poses.empty());
}

TEST(PlanarPoseEstimator, ErrorIsTheSquaredDistanceAndInfiniteBehindTheCamera)
{
  const Landmark landmark{ { 0.1, 0.2 }, 0.5 };
  const std::vector<Sighting> sightings{ { landmark, { 0.13, 0.24 } } };
  const PlanarPoseEstimator estimator(sightings, THRESHOLD);
  EXPECT_NEAR(estimator.error({ 0.0, 0.0, 0.0 }, 0), 0.03 * 0.03 + 0.04 * 0.04, 1e-12);
  EXPECT_TRUE(std::isinf(estimator.error({ -3.0, 0.0, 0.0 }, 0)));
}

// ---- chance

TEST(LogSignificance, IsTheFormula)
{
  // (10 - 2) C(10, 5) C(5, 2) 0.1^3 = 8 x 252 x 10 / 1000.
  EXPECT_NEAR(logSignificance(10, 5, 2, 0.1), -std::log10(20.16), 1e-9);
}

TEST(LogSignificance, GrowsWithInliersAndFallsWithTheProbability)
{
  // From where chance would give that many on.
  for (std::size_t inliers = 20; inliers < 99; ++inliers)
  {
    EXPECT_GT(logSignificance(100, inliers + 1, 2, 0.05), logSignificance(100, inliers, 2, 0.05)) << inliers;
  }
  double last = std::numeric_limits<double>::infinity();
  for (const double probability : { 0.001, 0.01, 0.05, 0.2, 0.5, 1.0 })
  {
    const double significance = logSignificance(100, 40, 2, probability);
    EXPECT_LT(significance, last) << probability;
    last = significance;
  }
  EXPECT_LT(last, 0.0);  // what agrees anyway says nothing
  // Among more candidates the same number is less remarkable.
  EXPECT_GT(logSignificance(60, 40, 2, 0.05), logSignificance(600, 40, 2, 0.05));
}

TEST(LogSignificance, TheSampleItselfCountsForNothing)
{
  EXPECT_EQ(logSignificance(100, 0, 2, 0.01), 0.0);
  EXPECT_EQ(logSignificance(100, 2, 2, 0.01), 0.0);
  EXPECT_EQ(logSignificance(2, 2, 2, 1e-9), 0.0);
  EXPECT_GT(logSignificance(3, 3, 2, 1e-9), 0.0);
}

TEST(Significance, IsHighForAMotionAndLowForChance)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    Rng rng(seed);
    EXPECT_LT(significanceOf(pairsOf(truths()[0], 0, 150, rng), seed), 2.0) << seed;
    EXPECT_GT(significanceOf(pairsOf(truths()[0], 45, 105, rng), seed), 15.0) << seed;
  }
}

TEST(ChanceAmong, CountsPairsOfDifferentInliers)
{
  const auto always = [](std::size_t, std::size_t) {
    return true;
  };
  const auto never = [](std::size_t, std::size_t) {
    return false;
  };
  const auto itself = [](std::size_t reference, std::size_t current) {
    return reference == current;
  };
  const auto neighbours = [](std::size_t reference, std::size_t current) {
    return (reference + 1) % 10 == current;
  };
  EXPECT_EQ(chanceAmong(10, always), 1.0);
  EXPECT_EQ(chanceAmong(10, never), 0.0);
  EXPECT_EQ(chanceAmong(10, itself), 0.0);
  EXPECT_NEAR(chanceAmong(10, neighbours), 1.0 / 9.0, 1e-12);
  EXPECT_EQ(chanceAmong(0, always), 0.0);
  EXPECT_EQ(chanceAmong(1, always), 0.0);
  // Of very many, a part will do.
  std::size_t asked = 0;
  EXPECT_EQ(chanceAmong(1000,
                        [&asked](std::size_t, std::size_t) {
                          ++asked;
                          return true;
                        }),
            1.0);
  EXPECT_LT(asked, 10000U);
}

TEST(ChanceAmong, IsHighAlongOneEpipolarLineAndLowForScatteredPoints)
{
  // Driving straight ahead, the epipole is the middle of both images.
  const PlanarPose pose{ 1.0, 0.0, 0.0 };
  const PlanarMotion motion(pose);
  Rng rng(9);
  Correspondences along;
  Correspondences scattered;
  while (along.size() < 60)
  {
    const Eigen::Vector2d on_it = uniform(rng, 0.1, 0.55) * Eigen::Vector2d(0.8, 0.6);
    const Eigen::Vector2d current = moved(on_it, uniform(rng, 1.5, 6.0), pose);
    if (current.allFinite())
    {
      along.push_back({ on_it, current });
    }
  }
  scattered = pairsOf(pose, 60, 0, rng);
  EXPECT_GT(among(along, motion), 0.95);
  EXPECT_LT(among(scattered, motion), 0.06);
  EXPECT_LT(logSignificance(along.size(), along.size(), SAMPLE_SIZE, among(along, motion)), 0.0);
}

}  // namespace view_servo
