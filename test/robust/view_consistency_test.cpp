// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/view_consistency.h"

#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace view_servo
{
namespace
{
std::array<Correspondence, 5> firstFive(const Correspondences& pairs)
{
  std::array<Correspondence, 5> five;
  std::copy_n(pairs.begin(), 5, five.begin());
  return five;
}

std::array<Correspondence, 5> randomFive(Rng& rng)
{
  std::array<Correspondence, 5> five;
  for (Correspondence& pair : five)
  {
    pair.reference = test::randomPixel(rng);
    pair.current = test::randomPixel(rng);
  }
  return five;
}

/** Applies a similarity to one view. */
std::array<Correspondence, 5> moved(std::array<Correspondence, 5> five, Eigen::Vector2d Correspondence::*side,
                                    double scale, double angle, const Eigen::Vector2d& offset)
{
  for (Correspondence& pair : five)
  {
    pair.*side = scale * (Eigen::Rotation2Dd(angle) * pair.*side) + offset;
  }
  return five;
}

RC_GTEST_PROP(ViewConstraint, VanishesOnExactScaledOrthographicViews, (std::uint64_t seed))
{
  Rng rng(seed);
  RC_ASSERT(viewConstraint(firstFive(test::scaledOrthographicPairs(5, rng))) < 1e-6);
}

RC_GTEST_PROP(ViewConstraint, IsInvariantToScaleRotationAndTranslationOfEitherView, (std::uint64_t seed))
{
  Rng rng(seed);
  const auto five = randomFive(rng);
  const double value = viewConstraint(five);
  RC_ASSERT(value >= 0.0 && value <= 1.0);
  for (const auto side : { &Correspondence::reference, &Correspondence::current })
  {
    const double scale = std::exp(uniform(rng, -4.0, 4.0));
    const double angle = uniform(rng, -3.0, 3.0);
    const Eigen::Vector2d offset = test::randomPixel(rng);
    RC_ASSERT(std::abs(viewConstraint(moved(five, side, scale, angle, offset)) - value) < 1e-8);
  }
}

TEST(ViewConstraint, IsLargeOnRandomData)
{
  Rng rng(1);
  int large = 0;
  double sum = 0.0;
  for (int i = 0; i < 1000; ++i)
  {
    const double value = viewConstraint(randomFive(rng));
    large += value > 0.1 ? 1 : 0;
    sum += value;
  }
  EXPECT_GT(large, 700);
  EXPECT_GT(sum / 1000.0, 0.3);
}

TEST(ViewConstraint, GrowsWithNoise)
{
  double previous = 0.0;
  for (const double noise : { 0.1, 1.0, 10.0 })
  {
    Rng rng(2);
    std::vector<double> values;
    for (int i = 0; i < 301; ++i)
    {
      auto five = firstFive(test::scaledOrthographicPairs(5, rng));
      for (Correspondence& pair : five)
      {
        pair.current += noise * Eigen::Vector2d(gaussian(rng), gaussian(rng));
      }
      values.push_back(viewConstraint(five));
    }
    std::nth_element(values.begin(), values.begin() + 150, values.end());
    EXPECT_GT(values[150], 2.0 * previous);
    previous = values[150];
  }
  EXPECT_LT(previous, 1.0);
}

TEST(ViewConstraint, DegenerateGroupsViolateIt)
{
  Rng rng(3);
  const auto exact = firstFive(test::scaledOrthographicPairs(5, rng));
  for (const auto side : { &Correspondence::reference, &Correspondence::current })
  {
    auto coincident = exact;
    for (Correspondence& pair : coincident)
    {
      pair.*side = { 100.0, 200.0 };
    }
    EXPECT_EQ(viewConstraint(coincident), 1.0);
    auto invalid = exact;
    (invalid[3].*side).x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(viewConstraint(invalid), 1.0);
  }
  // Points on one plane: any affine map between the views is consistent, and every determinant vanishes.
  auto planar = exact;
  Eigen::Matrix2d affine;
  affine << 1.2, 0.3, -0.2, 0.7;
  for (Correspondence& pair : planar)
  {
    pair.current = affine * pair.reference + Eigen::Vector2d(5.0, -8.0);
  }
  EXPECT_EQ(viewConstraint(planar), 1.0);
}

TEST(ViewConsistencyParams, EveryFaultIsReported)
{
  EXPECT_TRUE(ViewConsistencyParams().validate().empty());
  ViewConsistencyParams params;
  params.threshold = 0.0;
  EXPECT_EQ(params.validate().size(), 1U);
  params.threshold = std::numeric_limits<double>::quiet_NaN();
  params.mean_increments = -1.0;
  params.max_groups = 0;
  EXPECT_EQ(params.validate().size(), 3U);
}

/** `inliers` exact scaled-orthographic pairs with 1 px noise, then unrelated ones. */
Correspondences mixedPairs(int inliers, int outliers, Rng& rng)
{
  Correspondences pairs = test::scaledOrthographicPairs(inliers, rng);
  for (Correspondence& pair : pairs)
  {
    const double u = gaussian(rng);
    pair.current += Eigen::Vector2d(u, gaussian(rng));
  }
  for (int i = 0; i < outliers; ++i)
  {
    const Eigen::Vector2d reference = test::randomPixel(rng);
    pairs.push_back({ reference, test::randomPixel(rng) });
  }
  return pairs;
}

TEST(ViewConsistentCandidates, SeparatesInliersFromOutliers)
{
  std::ptrdiff_t inliers = 0;
  std::ptrdiff_t outliers = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    Rng rng(seed);
    const Correspondences pairs = mixedPairs(60, 40, rng);
    const std::vector<int> kept = viewConsistentCandidates(pairs, ViewConsistencyParams(), rng);
    const auto first_outlier = std::lower_bound(kept.begin(), kept.end(), 60);
    EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
    inliers += first_outlier - kept.begin();
    outliers += kept.end() - first_outlier;
  }
  EXPECT_GE(inliers, 540);  // of 600
  EXPECT_LE(outliers, 80);  // of 400
}

TEST(ViewConsistentCandidates, SameSeedGivesTheSameResult)
{
  Rng data_rng(4);
  const Correspondences pairs = mixedPairs(30, 30, data_rng);
  Rng first(5);
  Rng second(5);
  EXPECT_EQ(viewConsistentCandidates(pairs, ViewConsistencyParams(), first),
            viewConsistentCandidates(pairs, ViewConsistencyParams(), second));
  EXPECT_EQ(first, second);
}

TEST(ViewConsistentCandidates, KeepsAllWhenThereIsNothingToSplit)
{
  Rng rng(6);
  EXPECT_TRUE(viewConsistentCandidates({}, ViewConsistencyParams(), rng).empty());
  const Correspondences four = mixedPairs(0, 4, rng);
  EXPECT_EQ(viewConsistentCandidates(four, ViewConsistencyParams(), rng), (std::vector<int>{ 0, 1, 2, 3 }));
  // Five exact pairs are counted equally often; coincident ones never.
  const Correspondences five = test::scaledOrthographicPairs(5, rng);
  EXPECT_EQ(viewConsistentCandidates(five, ViewConsistencyParams(), rng).size(), 5U);
  const Correspondences coincident(12, five[0]);
  ViewConsistencyParams params;
  params.max_groups = 500;
  EXPECT_EQ(viewConsistentCandidates(coincident, params, rng).size(), 12U);
}

/** A generator after as many groups of five were drawn from `candidates`. */
Rng afterDraws(int groups, int candidates, Rng rng)
{
  std::vector<int> group;
  for (int i = 0; i < groups; ++i)
  {
    detail::drawDistinct(rng, candidates, 5, group);
  }
  return rng;
}

TEST(ViewConsistentCandidates, DrawsNoMoreGroupsThanAllowed)
{
  // Coincident candidates are never consistent: only the limit ends the drawing, after exactly that many draws.
  const Correspondences coincident(12, Correspondence{ { 1, 2 }, { 3, 4 } });
  ViewConsistencyParams params;
  params.max_groups = 37;
  Rng rng(7);
  viewConsistentCandidates(coincident, params, rng);
  EXPECT_EQ(rng, afterDraws(37, 12, Rng(7)));
}

TEST(ViewConsistentCandidates, StopsWhenCountedOftenEnough)
{
  // All groups of exact data are consistent: each draw adds five increments.
  Rng data_rng(8);
  const Correspondences pairs = test::scaledOrthographicPairs(20, data_rng);
  ViewConsistencyParams params;
  params.mean_increments = 3.0;
  Rng rng(8);
  viewConsistentCandidates(pairs, params, rng);
  EXPECT_EQ(rng, afterDraws(12, 20, Rng(8)));
}

}  // namespace
}  // namespace view_servo
