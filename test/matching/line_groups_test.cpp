// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_groups.h"

#include "support/synthetic_scene.h"  // seeds RapidCheck

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{

constexpr double COLLINEARITY = 1e-6;  // for exact constructions [px]

Segments randomSegments(std::mt19937_64& rng, int count)
{
  Segments segments;
  while (static_cast<int>(segments.size()) < count)
  {
    const Segment segment{ { uniform(rng, 20.0, 300.0), uniform(rng, 20.0, 300.0) },
                           { uniform(rng, 20.0, 300.0), uniform(rng, 20.0, 300.0) } };
    if (segment.length() > 15.0)
    {
      segments.push_back(segment);
    }
  }
  return segments;
}

/** A homography with positive determinant that keeps [0, 320]² in front of the camera. */
Eigen::Matrix3d randomHomography(std::mt19937_64& rng)
{
  const double roll = uniform(rng, -M_PI, M_PI);
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h.topLeftCorner<2, 2>() =
      Eigen::Rotation2Dd(roll).toRotationMatrix() *
      (Eigen::Matrix2d() << uniform(rng, 0.6, 1.6), uniform(rng, -0.4, 0.4), 0.0, uniform(rng, 0.6, 1.6)).finished();
  h(0, 2) = uniform(rng, -100.0, 100.0);
  h(1, 2) = uniform(rng, -100.0, 100.0);
  h(2, 0) = uniform(rng, -1e-3, 1e-3);
  h(2, 1) = uniform(rng, -1e-3, 1e-3);
  return h;
}

Segment mapped(const Eigen::Matrix3d& h, const Segment& segment)
{
  return { (h * segment.start.homogeneous()).hnormalized(), (h * segment.end.homogeneous()).hnormalized() };
}

}  // namespace

TEST(PairIndex, HasTheDigitsOfTheThesis)
{
  // a runs to the right; b's start lies above it (in the image: smaller v, the left side), its end below.
  const Segment a{ { 0.0, 0.0 }, { 10.0, 0.0 } };
  const Segment b{ { 5.0, -5.0 }, { 5.0, 5.0 } };
  // Digits: b.start left of a (-1), b.end right (+1), a.start right of b (+1), a.end left (-1).
  EXPECT_EQ(pairIndex(a, b, 0.5), 0 * 27 + 2 * 9 + 2 * 3 + 0);
  const Segment touching{ { 5.0, 0.2 }, { 5.0, 5.0 } };
  EXPECT_EQ(pairIndex(a, touching, 0.5), 1 * 27 + 2 * 9 + 2 * 3 + 0);
  EXPECT_EQ(pairIndex(a, a, 0.5), 40);
}

TEST(PairIndex, ToleranceIsADistanceInPixels)
{
  for (const double length : { 5.0, 500.0 })
  {
    const Segment a{ { 0.0, 0.0 }, { length, 0.0 } };
    const Segment near{ { 1.0, 1.9 }, { 3.0, 50.0 } };
    const Segment off{ { 1.0, 2.1 }, { 3.0, 50.0 } };
    EXPECT_EQ(pairIndex(a, near, 2.0) / 27, 1);
    EXPECT_EQ(pairIndex(a, off, 2.0) / 27, 2);
  }
}

TEST(PairIndex, ThereAreTwentyFiveClasses)
{
  // End points on a coarse grid show all incidences of two segments, general ones and those with collinear points.
  std::set<int> in_order;        // directed segments, in the sense of rotation: what groups are made of
  std::set<int> up_to_exchange;  // directed segments, either first
  std::set<int> all;
  const auto point = [](int i) {
    return Eigen::Vector2d(i % 4, i / 4);
  };
  for (int i = 0; i < 16 * 16 * 16 * 16; ++i)
  {
    const Segment a{ point(i % 16), point(i / 16 % 16) };
    const Segment b{ point(i / 256 % 16), point(i / 4096) };
    if (a.length() == 0.0 || b.length() == 0.0)
    {
      continue;
    }
    const int index = pairIndex(a, b, COLLINEARITY);
    all.insert(index);
    up_to_exchange.insert(std::min(index, pairIndex(b, a, COLLINEARITY)));
    const Eigen::Vector2d da = a.end - a.start;
    const Eigen::Vector2d db = b.end - b.start;
    if (da.x() * db.y() - da.y() * db.x() > 0.0)
    {
      in_order.insert(index);
    }
  }
  EXPECT_EQ(in_order.size(), 25U);  // figure 4.4
  EXPECT_EQ(up_to_exchange.size(), 25U);
  EXPECT_EQ(all.size(), 47U);  // of 81 combinations of signs
}

TEST(PairIndex, IsInvariantUnderHomographiesThatKeepTheSides)
{
  std::mt19937_64 rng(5);
  int compared = 0;
  for (int round = 0; round < 300; ++round)
  {
    const Segments segments = randomSegments(rng, 2);
    const Eigen::Matrix3d h = randomHomography(rng);
    const int before = pairIndex(segments[0], segments[1], COLLINEARITY);
    EXPECT_EQ(before, pairIndex(mapped(h, segments[0]), mapped(h, segments[1]), COLLINEARITY));
    ++compared;
  }
  EXPECT_EQ(compared, 300);
}

TEST(LineIntersection, IsOnBothLinesUnlessTheyAreNearlyParallel)
{
  const Segment a{ { 0.0, 0.0 }, { 10.0, 0.0 } };
  const auto at = lineIntersection(a, { { 20.0, 5.0 }, { 21.0, 6.0 } }, std::sin(0.1));
  ASSERT_TRUE(at.has_value());
  EXPECT_NEAR(at->x(), 15.0, 1e-9);
  EXPECT_NEAR(at->y(), 0.0, 1e-9);
  const auto turned = [](double angle) {
    return Segment{ { 0.0, 5.0 }, { 100.0 * std::cos(angle), 5.0 + 100.0 * std::sin(angle) } };
  };
  EXPECT_FALSE(lineIntersection(a, turned(0.0), std::sin(0.1)).has_value());
  EXPECT_FALSE(lineIntersection(a, turned(0.099), std::sin(0.1)).has_value());
  EXPECT_FALSE(lineIntersection(a, turned(M_PI - 0.099), std::sin(0.1)).has_value());
  EXPECT_TRUE(lineIntersection(a, turned(0.101), std::sin(0.1)).has_value());
}

RC_GTEST_PROP(PairHypotheses, WeightsSumToOne, (std::uint64_t seed))
{
  std::mt19937_64 rng(seed);
  const Segments segments = randomSegments(rng, 2);
  const auto at = lineIntersection(segments[0], segments[1], std::sin(0.1));
  double sum = 0.0;
  for (const PairHypothesis& hypothesis : pairHypotheses(segments[0], segments[1], at, 2.0))
  {
    RC_ASSERT(hypothesis.weight >= 0.0);
    RC_ASSERT(hypothesis.index >= 0);
    RC_ASSERT(hypothesis.index < PAIR_INDICES);
    sum += hypothesis.weight;
  }
  RC_ASSERT(std::abs(sum - 1.0) < 1e-9);
}

TEST(PairHypotheses, AnEndMovedToTheIntersectionLiesOnTheOtherLine)
{
  // An L with a gap of a quarter of each arm.
  const Segment a{ { 5.0, 0.0 }, { 25.0, 0.0 } };
  const Segment b{ { 0.0, 5.0 }, { 0.0, 25.0 } };
  const auto found = pairHypotheses(a, b, Eigen::Vector2d(0.0, 0.0), 0.5);
  EXPECT_NEAR(found[0].weight, 0.0625, 1e-9);
  EXPECT_NEAR(found[1].weight, 0.5625, 1e-9);
  EXPECT_NEAR(found[2].weight, 0.1875, 1e-9);
  EXPECT_NEAR(found[3].weight, 0.1875, 1e-9);
  EXPECT_EQ(found[0].index, pairIndex(a, b, 0.5));
  EXPECT_EQ(found[1].index / 27, 1);     // b's start on a
  EXPECT_EQ(found[1].index / 3 % 3, 1);  // a's start on b
  EXPECT_EQ(found[2].index / 3 % 3, 1);  // only a extended: its start on b
  EXPECT_NE(found[2].index / 27, 1);
  EXPECT_EQ(found[3].index / 27, 1);
  EXPECT_NE(found[3].index / 3 % 3, 1);
}

TEST(TripletKey, IsUniqueOverAllCombinations)
{
  for (const int classes : { 2, 8 })
  {
    std::vector<char> seen(
        static_cast<std::size_t>(PAIR_INDICES) * PAIR_INDICES * PAIR_INDICES * static_cast<std::size_t>(classes), 0);
    for (int p1 = 0; p1 < PAIR_INDICES; ++p1)
    {
      for (int p2 = 0; p2 < PAIR_INDICES; ++p2)
      {
        for (int p3 = 0; p3 < PAIR_INDICES; ++p3)
        {
          for (int c = 0; c < classes; ++c)
          {
            const std::uint32_t key = tripletKey(p1, p2, p3, c, classes);
            ASSERT_LT(key, seen.size());
            ASSERT_EQ(seen[key], 0);
            seen[key] = 1;
          }
        }
      }
    }
  }
}

class LineGroupsTest : public testing::TestWithParam<LineGrouping>
{
};

TEST_P(LineGroupsTest, OfAPlaneSeenFromElsewhereHaveTheSameKeys)
{
  std::mt19937_64 rng(11);
  LineGroupParams params;
  params.groups = GetParam();
  params.max_distance = 1e6;  // all pairs, in both views
  params.max_neighbours = 0;
  params.collinearity = 1e-3;
  params.min_angle_deg = 0.01;
  params.min_weight = 0.0;
  for (int round = 0; round < 10; ++round)
  {
    const Segments segments = randomSegments(rng, 6);
    // Affine and with any roll: the weights too depend on ratios along a line, which only affine maps keep.
    Eigen::Matrix3d h = randomHomography(rng);
    h.row(2) << 0.0, 0.0, 1.0;
    Segments seen;
    for (const Segment& segment : segments)
    {
      seen.push_back(mapped(h, segment));
    }
    const LineIndex reference(segments, params);
    const LineIndex current(seen, params);
    ASSERT_FALSE(reference.groups().empty());
    ASSERT_EQ(reference.groups().size(), current.groups().size());
    for (std::size_t i = 0; i < reference.groups().size(); ++i)
    {
      EXPECT_EQ(reference.groups()[i].key, current.groups()[i].key);
      EXPECT_EQ(reference.groups()[i].segments, current.groups()[i].segments);
      EXPECT_NEAR(reference.groups()[i].weight, current.groups()[i].weight, 1e-4);
    }
  }
}

TEST_P(LineGroupsTest, VoteForTheTrueCounterpart)
{
  std::mt19937_64 rng(3);
  LineGroupParams params;
  params.groups = GetParam();
  const Segments segments = randomSegments(rng, 40);
  Eigen::Matrix3d h = randomHomography(rng);
  h.row(2) << 2e-4, -1e-4, 1.0;
  std::vector<int> order(segments.size());
  for (std::size_t i = 0; i < order.size(); ++i)
  {
    order[i] = static_cast<int>((7 * i + 3) % order.size());
  }
  Segments seen;
  for (const int i : order)
  {
    seen.push_back(mapped(h, segments[static_cast<std::size_t>(i)]));
  }
  const AssociationMatrix votes = associateLines(LineIndex(segments, params), LineIndex(seen, params));
  int right = 0;
  for (std::size_t k = 0; k < order.size(); ++k)
  {
    int best = -1;
    double most = 0.0;
    for (int i = 0; i < votes.rows(); ++i)
    {
      const double weight = votes.weight(i, static_cast<int>(k));
      if (weight > most)
      {
        most = weight;
        best = i;
      }
    }
    right += best == order[k] ? 1 : 0;
  }
  EXPECT_GE(right, GetParam() == LineGrouping::TRIPLETS ? 34 : 10);
}

INSTANTIATE_TEST_SUITE_P(Both, LineGroupsTest, testing::Values(LineGrouping::PAIRS, LineGrouping::TRIPLETS));

TEST(LineIndex, UprightOrderPairsVerticalsWithOthers)
{
  LineGroupParams params;
  params.order = LineOrder::UPRIGHT;
  params.groups = LineGrouping::PAIRS;
  params.min_weight = 0.0;
  const Segment vertical{ { 10.0, 10.0 }, { 10.0, 60.0 } };
  const Segment level{ { 15.0, 30.0 }, { 60.0, 30.0 } };
  const Segment another{ { 15.0, 50.0 }, { 60.0, 55.0 } };
  const LineIndex index({ level, another, vertical }, params);
  ASSERT_FALSE(index.groups().empty());
  for (const LineGroup& group : index.groups())
  {
    EXPECT_EQ(group.segments[0], 2);  // the vertical one first
    EXPECT_EQ(group.segments[2], -1);
  }
  // The sense in which the end points are given does not matter.
  const LineIndex reversed({ level.reversed(), another, vertical.reversed() }, params);
  ASSERT_EQ(reversed.groups().size(), index.groups().size());
  for (std::size_t i = 0; i < index.groups().size(); ++i)
  {
    EXPECT_EQ(index.groups()[i].key, reversed.groups()[i].key);
  }
}

TEST(LineIndex, BoundsTheGroupsOfASegment)
{
  std::mt19937_64 rng(8);
  LineGroupParams params;
  params.max_neighbours = 5;
  const LineIndex index(randomSegments(rng, 400), params);
  // 400 segments of at most 5 pairs each make at most 10 triplets each, of at most 64 structures.
  EXPECT_LE(index.groups().size(), 400U * 10U * 64U);
  EXPECT_GT(index.groups().size(), 400U);
}

TEST(LineIndex, RefusesBadInput)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(LineIndex({ { { 0.0, 0.0 }, { nan, 1.0 } } }, LineGroupParams()), std::invalid_argument);
  EXPECT_THROW(LineIndex({ { { 1.0, 1.0 }, { 1.0, 1.0 } } }, LineGroupParams()), std::invalid_argument);
  LineGroupParams params;
  params.max_distance = 0.0;
  params.collinearity = -1.0;
  params.min_angle_deg = 90.0;
  params.max_neighbours = -1;
  params.min_weight = 1.0;
  EXPECT_EQ(params.validate().size(), 5U);
  EXPECT_THROW(LineIndex({}, params), std::invalid_argument);
  EXPECT_TRUE(LineIndex({}, LineGroupParams()).groups().empty());
  EXPECT_TRUE(associateLines(LineIndex({}, LineGroupParams()), LineIndex({}, LineGroupParams())).entries().empty());
}

}  // namespace view_servo
