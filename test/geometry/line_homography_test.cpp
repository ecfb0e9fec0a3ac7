// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/line_homography.h"

#include "support/corner_error.h"
#include "support/synthetic_scene.h"
#include "view_servo/robust/line_homography_estimator.h"
#include "view_servo/robust/ransac.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>
#include <optional>
#include <random>

namespace view_servo
{
namespace
{
Eigen::Matrix3d rolledHomography()
{
  Eigen::Matrix3d h;
  h << 0.8, -0.3, 90.0, 0.25, 0.9, -20.0, 3e-4, -2e-4, 1.0;
  return h;
}

Segment randomSegment(std::mt19937_64& rng)
{
  const Eigen::Vector2d start(uniform(rng, 0.0, 640.0), uniform(rng, 0.0, 480.0));
  const double angle = uniform(rng, -M_PI, M_PI);
  return { start, start + uniform(rng, 30.0, 120.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle)) };
}

/** The segment that H makes of one, with other ends: `cut` is left out at the start, `more` added, as parts of it. */
Segment seen(const Eigen::Matrix3d& h, const Segment& segment, double cut, double more)
{
  const Segment whole = *transfer(h, segment);
  const Eigen::Vector2d d = whole.end - whole.start;
  return { whole.start + cut * d, whole.end + more * d };
}

SegmentPairs randomPairs(std::mt19937_64& rng, const Eigen::Matrix3d& h, int count)
{
  SegmentPairs pairs;
  for (int i = 0; i < count; ++i)
  {
    const Segment segment = randomSegment(rng);
    pairs.push_back({ segment, seen(h, segment, uniform(rng, -0.2, 0.3), uniform(rng, -0.3, 0.3)) });
  }
  return pairs;
}

/** In a 640x480 image [px]. */
double difference(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return test::largestCornerError(a, b, { 640, 480 });
}

}  // namespace

TEST(LineHomography, IsExactWhateverPartsOfTheLinesAreSeen)
{
  std::mt19937_64 rng(1);
  for (const int count : { 4, 5, 20 })
  {
    for (int round = 0; round < 20; ++round)
    {
      const auto found = homographyFromLines(randomPairs(rng, rolledHomography(), count));
      ASSERT_TRUE(found.has_value());
      EXPECT_LT(difference(*found, rolledHomography()), 1e-3) << count << " lines";
    }
  }
}

TEST(LineHomography, AffinityOfThreeLinesIsExact)
{
  std::mt19937_64 rng(2);
  Eigen::Matrix3d affinity = rolledHomography();
  affinity.row(2) << 0.0, 0.0, 1.0;
  for (int round = 0; round < 20; ++round)
  {
    const auto found = affinityFromLines(randomPairs(rng, affinity, 3));
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(difference(*found, affinity), 1e-3);
  }
}

TEST(LineHomography, IsEmptyWhenTheLinesLeaveItOpen)
{
  std::mt19937_64 rng(3);
  EXPECT_FALSE(homographyFromLines({}).has_value());
  EXPECT_FALSE(homographyFromLines(randomPairs(rng, rolledHomography(), 3)).has_value());
  EXPECT_FALSE(affinityFromLines(randomPairs(rng, rolledHomography(), 2)).has_value());
  SegmentPairs parallel;
  SegmentPairs concurrent;
  for (int i = 0; i < 6; ++i)
  {
    const Segment level{ { 10.0, 20.0 * i }, { 110.0, 20.0 * i } };
    parallel.push_back({ level, level });
    const Eigen::Vector2d direction(std::cos(0.5 * i), std::sin(0.5 * i));
    const Segment ray{ Eigen::Vector2d(100.0, 100.0) + 20.0 * direction,
                       Eigen::Vector2d(100.0, 100.0) + 90.0 * direction };
    concurrent.push_back({ ray, ray });
  }
  EXPECT_FALSE(homographyFromLines(parallel).has_value());
  EXPECT_FALSE(homographyFromLines(concurrent).has_value());
  EXPECT_FALSE(affinityFromLines(parallel).has_value());
}

TEST(PlausibleAffinity, FitsPointsAndRefusesWhatDistortsTooMuch)
{
  const Eigen::Vector2d from[4] = { { 10.0, 20.0 }, { 90.0, 30.0 }, { 40.0, 80.0 }, { 70.0, 70.0 } };
  const double weights[4] = { 1.0, 1.0, 0.3, 0.3 };
  const auto fitted = [&](double a, double b, double c, double d) {
    Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
    map.topRows<2>() << a, b, 5.0, c, d, -7.0;
    Eigen::Vector2d to[4];
    for (int i = 0; i < 4; ++i)
    {
      to[i] = (map * from[i].homogeneous()).head<2>();
    }
    const auto found = plausibleAffinity(from, to, weights, 4, AffinityLimits());
    if (found)
    {
      EXPECT_LT((*found - map).norm(), 1e-9);
    }
    return found.has_value();
  };
  EXPECT_TRUE(fitted(1.2, 0.3, -0.2, 0.8));
  EXPECT_TRUE(fitted(4.9, 0.0, 0.0, 4.9));
  EXPECT_FALSE(fitted(5.1, 0.0, 0.0, 5.1));
  EXPECT_FALSE(fitted(0.19, 0.0, 0.0, 0.19));
  EXPECT_TRUE(fitted(2.2, 0.0, 0.0, 0.4));
  EXPECT_FALSE(fitted(2.4, 0.0, 0.0, 0.4));  // 6 times as far in one direction
  EXPECT_FALSE(fitted(-1.0, 0.0, 0.0, 1.0));
  const Eigen::Vector2d on_a_line[3] = { { 0.0, 0.0 }, { 10.0, 10.0 }, { 20.0, 20.1 } };
  EXPECT_FALSE(plausibleAffinity(on_a_line, on_a_line, weights, 3, AffinityLimits()).has_value());
}

TEST(LineHomography, TransferStopsAtTheHorizon)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(2, 0) = -0.01;  // infinity is at u = 100
  EXPECT_TRUE(transfer(h, Segment{ { 10.0, 10.0 }, { 50.0, 10.0 } }).has_value());
  EXPECT_FALSE(transfer(h, Segment{ { 10.0, 10.0 }, { 99.0, 10.0 } }).has_value());
  EXPECT_FALSE(transfer(h, Segment{ { 150.0, 10.0 }, { 10.0, 10.0 } }).has_value());
}

TEST(CompareSegments, SaysHowTheyLieToEachOther)
{
  const Segment a{ { 0.0, 0.0 }, { 100.0, 0.0 } };
  const SegmentAgreement half = compare(a, { { 50.0, 2.0 }, { 200.0, 2.0 } });
  EXPECT_NEAR(half.distance, 2.0, 1e-9);
  EXPECT_NEAR(half.cosine, 1.0, 1e-9);
  EXPECT_NEAR(half.overlap, 0.5, 1e-9);
  EXPECT_NEAR(half.share, 0.25, 1e-9);
  EXPECT_NEAR(compare(a, a.reversed()).cosine, -1.0, 1e-9);
  EXPECT_NEAR(compare(a, a.reversed()).share, 1.0, 1e-9);
  // Not side by side.
  EXPECT_TRUE(std::isinf(compare(a, { { 101.0, 0.0 }, { 150.0, 0.0 } }).distance));
  EXPECT_EQ(compare(a, { { 101.0, 0.0 }, { 150.0, 0.0 } }).overlap, 0.0);
  // The distance is the larger of the two ends of what they share.
  EXPECT_NEAR(compare(a, { { 0.0, 0.0 }, { 100.0, 5.0 } }).distance, 5.0, 0.05);
}

TEST(LineHomographyEstimator, FindsThePlaneAmongFalseMatches)
{
  std::mt19937_64 rng(4);
  SegmentPairs pairs = randomPairs(rng, rolledHomography(), 30);
  for (int i = 0; i < 40; ++i)
  {
    pairs.push_back({ randomSegment(rng), randomSegment(rng) });
  }
  RansacParams params;
  params.inlier_threshold = 1.0;
  params.sampling = Sampling::UNIFORM;
  Rng draws(7);
  const auto result = ransac(LineHomographyEstimator(pairs), params, draws);
  ASSERT_TRUE(result.model.has_value());
  EXPECT_LT(difference(result.model->h, rolledHomography()), 0.1);
  EXPECT_GE(result.inliers.size(), 30U);
  EXPECT_LE(result.inliers.size(), 32U);
}

TEST(LineHomographyEstimator, RefusesDegenerateSamples)
{
  SegmentPairs pairs;
  for (const double v : { 0.0, 40.0, 80.0 })
  {
    pairs.push_back({ { { 0.0, v }, { 100.0, v } }, { { 0.0, v }, { 100.0, v } } });
  }
  pairs.push_back({ { { 0.0, 0.0 }, { 0.0, 80.0 } }, { { 0.0, 0.0 }, { 0.0, 80.0 } } });
  pairs.push_back({ { { 100.0, 0.0 }, { 90.0, 80.0 } }, { { 100.0, 0.0 }, { 90.0, 80.0 } } });
  const LineHomographyEstimator estimator(pairs);
  EXPECT_FALSE(estimator.accepts({ 0, 1, 2, 3 }));
  EXPECT_TRUE(estimator.accepts({ 0, 2, 3, 4 }));
  // A segment that the homography sends elsewhere along its own line supports nothing.
  LineHomographyEstimator::Model identity{ Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity() };
  const SegmentPairs apart{ { { { 0.0, 0.0 }, { 50.0, 0.0 } }, { { 60.0, 0.0 }, { 90.0, 0.0 } } } };
  EXPECT_TRUE(std::isinf(LineHomographyEstimator(apart).error(identity, 0)));
}

}  // namespace view_servo
