// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Random numbers and samples, and what drawing the best data first gains.
#include "ransac_problems.h"

#include "view_servo/robust/homography_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <vector>

namespace view_servo
{
namespace
{
// ---- random numbers

TEST(UniformIndex, StaysBelowTheCount)
{
  Rng rng(1);
  for (int i = 0; i < 1000; ++i)
  {
    EXPECT_EQ(uniformIndex(rng, 1), 0U);
    EXPECT_LT(uniformIndex(rng, 7), 7U);
  }
}

TEST(UniformIndex, DrawsAreFixedByTheGenerator)
{
  // std::mt19937_64's 10000th output after default construction is given in the standard ([rand.predef]).
  Rng rng;
  rng.discard(9999);
  EXPECT_EQ(uniformIndex(rng, 1000), 9981545732273789042ULL % 1000U);
}

TEST(UniformIndex, HasNoModuloBias)
{
  // Plain modulo would hit the first third of [0, 3 * 2^62) half of the time.
  Rng rng(2);
  const std::size_t third = std::size_t{ 1 } << 62;
  int low = 0;
  for (int i = 0; i < 30000; ++i)
  {
    low += uniformIndex(rng, 3 * third) < third ? 1 : 0;
  }
  EXPECT_NEAR(low, 10000, 400);  // five deviations
}

TEST(DrawDistinct, EverySetIsEquallyLikely)
{
  Rng rng(3);
  std::map<std::set<int>, int> seen;
  std::vector<int> sample;
  for (int i = 0; i < 10000; ++i)
  {
    detail::drawDistinct(rng, 5, 3, sample);
    ASSERT_EQ(sample.size(), 3U);
    ++seen[std::set<int>(sample.begin(), sample.end())];
  }
  ASSERT_EQ(seen.size(), 10U);  // all of three distinct indices below 5
  for (const auto& entry : seen)
  {
    EXPECT_EQ(entry.first.size(), 3U);
    EXPECT_NEAR(entry.second, 1000, 150);
  }
}

TEST(DrawDistinct, TakesAllWhenAllAreWanted)
{
  Rng rng(4);
  std::vector<int> sample;
  detail::drawDistinct(rng, 4, 4, sample);
  std::sort(sample.begin(), sample.end());
  EXPECT_EQ(sample, (std::vector<int>{ 0, 1, 2, 3 }));
}

TEST(RandomOrder, IsAPermutationWithEveryPlaceEquallyLikely)
{
  Rng rng(5);
  std::array<int, 4> place_of_first{};
  for (int i = 0; i < 8000; ++i)
  {
    const std::vector<int> order = detail::randomOrder(rng, 4);
    ASSERT_TRUE(std::is_permutation(order.begin(), order.end(), std::vector<int>{ 0, 1, 2, 3 }.begin()));
    ++place_of_first[std::find(order.begin(), order.end(), 0) - order.begin()];
  }
  for (const int count : place_of_first)
  {
    EXPECT_NEAR(count, 2000, 200);
  }
}

// ---- progressive sampling

TEST(Sampler, ProgressiveStartsWithTheBestAndGrows)
{
  Rng rng(6);
  ListSampler sampler(Sampling::PROGRESSIVE, 100, 4, 1000.0);
  std::vector<int> sample;
  sampler.draw(rng, sample);
  EXPECT_EQ(std::set<int>(sample.begin(), sample.end()), (std::set<int>{ 0, 1, 2, 3 }));
  int newest = 3;
  for (int i = 0; i < 3000 && newest < 99; ++i)
  {
    sampler.draw(rng, sample);
    ASSERT_EQ(std::set<int>(sample.begin(), sample.end()).size(), 4U);
    const int last = *std::max_element(sample.begin(), sample.end());
    EXPECT_TRUE(last == newest || last == newest + 1) << "the newest datum is in every sample";
    newest = std::max(newest, last);
  }
  EXPECT_EQ(newest, 99);
}

TEST(Sampler, ProgressiveGrowthFollowsTheSchedule)
{
  // From the definition: T_n = T_N binom(n, m) / binom(N, m); T'_n sums the ceilings of its differences from 1 on.
  const auto expected = [](int n) {
    return 500.0 * n * (n - 1) / (50.0 * 49.0);
  };
  Rng rng(7);
  ListSampler sampler(Sampling::PROGRESSIVE, 50, 2, 500.0);
  std::vector<int> sample;
  std::map<int, int> drawn;
  for (int i = 0; i < 300; ++i)
  {
    sampler.draw(rng, sample);
    ++drawn[*std::max_element(sample.begin(), sample.end()) + 1];
  }
  EXPECT_EQ(drawn[2], 1);
  for (int n = 3; n < 30; ++n)
  {
    EXPECT_EQ(drawn[n], static_cast<int>(std::ceil(expected(n) - expected(n - 1)))) << n;
  }
}

TEST(Sampler, UniformOnceTheScheduleIsThrough)
{
  Rng rng(8);
  ListSampler sampler(Sampling::PROGRESSIVE, 10, 2, 20.0);
  std::vector<int> sample;
  for (int i = 0; i < 50; ++i)
  {
    sampler.draw(rng, sample);
  }
  std::array<int, 10> drawn{};
  for (int i = 0; i < 5000; ++i)
  {
    sampler.draw(rng, sample);
    ++drawn[sample[0]];
    ++drawn[sample[1]];
  }
  for (const int count : drawn)
  {
    EXPECT_NEAR(count, 1000, 150);
  }
}

TEST(Ransac, ProgressiveSamplingMeetsAGoodSampleSooner)
{
  // 10 % inliers, and an order in which most of them come early: an outlier's score is the larger one of a tenth.
  int progressive = 0;
  int uniform = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed)
  {
    Rng order_rng(seed);
    const Points unsorted = linePoints(50, 450, 0.5, seed);
    std::vector<std::pair<double, int>> ranked;
    for (int i = 0; i < 500; ++i)
    {
      ranked.emplace_back(-(gaussian(order_rng) + (i < 50 ? 1.5 : 0.0)), i);
    }
    std::sort(ranked.begin(), ranked.end());
    Points points;
    for (const auto& entry : ranked)
    {
      points.push_back(unsorted[entry.second]);
    }
    const auto samplesNeeded = [&](Sampling sampling) {
      RansacParams params;
      params.sampling = sampling;
      params.max_iterations = 5000;
      params.min_iterations = 5000;
      const LineEstimator estimator(points);
      Rng rng(seed);
      ransac(estimator, params, rng);
      const auto good = std::find_if(estimator.samples.begin(), estimator.samples.end(), [&](const auto& sample) {
        return ranked[sample[0]].second < 50 && ranked[sample[1]].second < 50;
      });
      return static_cast<int>(good - estimator.samples.begin()) + 1;
    };
    progressive += samplesNeeded(Sampling::PROGRESSIVE);
    uniform += samplesNeeded(Sampling::UNIFORM);
  }
  EXPECT_LT(5 * progressive, uniform);
}

TEST(Ransac, ProgressiveSamplingFindsAHomographyThatUniformSamplingCannot)
{
  const test::Scene scene = makeScene(true, 50, 450, 0.5, 9, false);  // inliers first, 1 in 10
  const HomographyEstimator estimator(scene.pairs);
  RansacParams params;
  params.max_iterations = 100;
  Rng rng(9);
  const auto progressive = ransac(estimator, params, rng);
  params.sampling = Sampling::UNIFORM;
  const auto uniform = ransac(estimator, params, rng);
  EXPECT_GE(trueInliers(progressive.inliers, scene), 45);
  EXPECT_LT(trueInliers(uniform.inliers, scene), 20);
}

}  // namespace
}  // namespace view_servo
