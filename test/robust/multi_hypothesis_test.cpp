// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/multi_hypothesis.h"

#include "support/synthetic_scene.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/assignment.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
/** Point i of one image is point i of the other; entries of `noise` |N(0, 1)| speak for others. */
struct Problem
{
  Points reference;
  Points current;
  AssociationMatrix association;
};

Problem ambiguous(bool planar, int count, double noise, Rng& rng)
{
  test::SceneOptions options;
  options.inliers = count;
  options.noise = 0.3;
  options.planar = planar;
  Problem problem;
  for (const Correspondence& pair : test::makeScene(options, rng).pairs)
  {
    problem.reference.push_back(pair.reference);
    problem.current.push_back(pair.current);
  }
  std::vector<Association> entries;
  for (int row = 0; row < count; ++row)
  {
    for (int column = 0; column < count; ++column)
    {
      entries.push_back({ row, column, row == column ? 1.0 : noise * std::abs(gaussian(rng)) });
    }
  }
  problem.association = AssociationMatrix(count, count, std::move(entries));
  return problem;
}

RansacParams ransacParams(double threshold, int iterations)
{
  RansacParams params;
  params.inlier_threshold = threshold;
  params.sampling = Sampling::UNIFORM;
  params.min_iterations = params.max_iterations = iterations;
  return params;
}

int correct(const std::vector<Association>& matches)
{
  return static_cast<int>(std::count_if(matches.begin(), matches.end(),
                                        [](const Association& match) { return match.row == match.column; }));
}

/** D of eq. 9.1, entry by entry. */
template <typename SquaredError>
AssociationMatrix fitMatrix(const Problem& problem, int entries_per_row, double threshold, double lambda,
                            const SquaredError& squared_error)
{
  const AssociationMatrix kept = problem.association.strongestOfRows(entries_per_row);
  double largest = 0.0;
  for (const Association& entry : kept.entries())
  {
    largest = std::max(largest, entry.weight);
  }
  std::vector<Association> fits;
  for (const Association& entry : kept.entries())
  {
    const double fit = std::sqrt(squared_error({ problem.reference[static_cast<std::size_t>(entry.row)],
                                                 problem.current[static_cast<std::size_t>(entry.column)] }));
    if (fit < threshold)
    {
      fits.push_back({ entry.row, entry.column, threshold - fit + lambda * entry.weight / largest });
    }
  }
  return AssociationMatrix(kept.rows(), kept.columns(), std::move(fits));
}

std::set<std::pair<int, int>> places(const std::vector<Association>& matches)
{
  std::set<std::pair<int, int>> result;
  for (const Association& match : matches)
  {
    result.insert({ match.row, match.column });
  }
  return result;
}

}  // namespace

TEST(MultiHypothesisParams, NameAllFaultsAtOnce)
{
  MultiHypothesisParams params;
  EXPECT_TRUE(params.validate().empty());
  params.entries_per_row = 0;
  params.association_weight = -0.1;
  EXPECT_EQ(params.validate().size(), 2U);
  params.association_weight = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 2U);
}

TEST(MultiHypothesis, RefusesListsOfOtherSizes)
{
  Rng rng(1);
  Problem problem = ambiguous(false, 20, 0.2, rng);
  problem.current.pop_back();
  EXPECT_THROW(
      estimateFundamental(problem.association, problem.reference, problem.current, ransacParams(1.0, 10), {}, rng),
      std::invalid_argument);
  EXPECT_THROW(
      estimateHomography(problem.association, problem.reference, problem.current, ransacParams(1.0, 10), {}, rng),
      std::invalid_argument);
}

TEST(MultiHypothesis, FindsNothingInTooLittle)
{
  Rng rng(1);
  const Problem problem = ambiguous(false, 6, 0.2, rng);
  for (const HypothesisSampling sampling : { HypothesisSampling::CANDIDATES, HypothesisSampling::IMPORTANCE })
  {
    MultiHypothesisParams params;
    params.sampling = sampling;
    const auto few = estimateFundamental(problem.association, problem.reference, problem.current, ransacParams(1.0, 50),
                                         params, rng);
    EXPECT_FALSE(few.model.has_value());
    EXPECT_TRUE(few.matches.empty());
    const auto none = estimateHomography({}, {}, {}, ransacParams(1.0, 50), params, rng);
    EXPECT_FALSE(none.model.has_value());
    EXPECT_EQ(none.statistics.stop, RansacStop::TOO_FEW_DATA);
  }
}

RC_GTEST_PROP(MultiHypothesis, MatchesAreTheHeaviestMatchingOfWhatAgrees, ())
{
  Rng rng(*rc::gen::inRange<std::uint64_t>(1, 1000000));
  const bool planar = *rc::gen::arbitrary<bool>();
  const double lambda = *rc::gen::element(0.0, 0.5, 2.0);
  const double threshold = *rc::gen::element(0.5, 1.0, 4.0);
  const Problem problem = ambiguous(planar, 60, 0.35, rng);
  MultiHypothesisParams params;
  params.entries_per_row = *rc::gen::inRange(1, 12);
  params.association_weight = lambda;
  std::vector<Association> expected;
  std::vector<Association> found;
  if (planar)
  {
    const auto result = estimateHomography(problem.association, problem.reference, problem.current,
                                           ransacParams(threshold, 60), params, rng);
    RC_ASSERT(result.model.has_value());
    expected = maximumWeightMatching(
        fitMatrix(problem, params.entries_per_row, threshold, lambda, [&](const Correspondence& pair) {
          return 0.5 * symmetricTransferError(result.model->h, result.model->h_inverse, pair);
        }));
    found = result.matches;
  }
  else
  {
    const auto result = estimateFundamental(problem.association, problem.reference, problem.current,
                                            ransacParams(threshold, 60), params, rng);
    RC_ASSERT(result.model.has_value());
    expected =
        maximumWeightMatching(fitMatrix(problem, params.entries_per_row, threshold, lambda,
                                        [&](const Correspondence& pair) { return sampsonError(*result.model, pair); }));
    found = result.matches;
  }
  RC_ASSERT(places(found) == places(expected));
  for (const Association& match : found)
  {
    RC_ASSERT(match.weight == problem.association.weight(match.row, match.column));
  }
}

TEST(MultiHypothesis, FindsMatchesThatAreNoCandidates)
{
  for (const bool planar : { false, true })
  {
    for (std::uint64_t seed = 1; seed <= 3; ++seed)
    {
      Rng rng(seed);
      const Problem problem = ambiguous(planar, 200, planar ? 0.36 : 0.34, rng);
      const auto candidates = maximumWeightMatching(problem.association.strongestOfRows(10));
      ASSERT_LT(correct(candidates), 155) << seed;
      std::vector<Association> matches;
      if (planar)
      {
        matches = estimateHomography(problem.association, problem.reference, problem.current, ransacParams(1.5, 1000),
                                     {}, rng)
                      .matches;
      }
      else
      {
        matches = estimateFundamental(problem.association, problem.reference, problem.current, ransacParams(1.0, 2000),
                                      {}, rng)
                      .matches;
      }
      EXPECT_GT(correct(matches), 1.25 * correct(candidates)) << seed << (planar ? ", planar" : "");
      EXPECT_LT(static_cast<int>(matches.size()) - correct(matches), 8) << seed << (planar ? ", planar" : "");
    }
  }
}

TEST(MultiHypothesis, IsRansacWhereNothingIsAmbiguous)
{
  // Thesis 9.5: with a permutation for an association the two are the same.
  Rng rng(3);
  test::SceneOptions options;
  options.inliers = 60;
  options.outliers = 40;
  options.noise = 0.3;
  const test::Scene scene = test::makeScene(options, rng);
  Problem problem;
  std::vector<Association> entries;
  for (int i = 0; i < 100; ++i)
  {
    problem.reference.push_back(scene.pairs[static_cast<std::size_t>(i)].reference);
    problem.current.push_back(scene.pairs[static_cast<std::size_t>(i)].current);
    entries.push_back({ i, i, 1.0 });
  }
  problem.association = AssociationMatrix(100, 100, std::move(entries));
  for (const HypothesisSampling sampling : { HypothesisSampling::CANDIDATES, HypothesisSampling::IMPORTANCE })
  {
    MultiHypothesisParams params;
    params.sampling = sampling;
    const auto several = estimateFundamental(problem.association, problem.reference, problem.current,
                                             ransacParams(1.0, 2000), params, rng);
    const auto one = ransac(FundamentalEstimator(scene.pairs), ransacParams(1.0, 2000), rng);
    ASSERT_TRUE(several.model && one.model);
    EXPECT_NEAR(static_cast<double>(several.matches.size()), static_cast<double>(one.inliers.size()), 2.0);
    int common = 0;
    for (const Association& match : several.matches)
    {
      common += std::binary_search(one.inliers.begin(), one.inliers.end(), match.row) ? 1 : 0;
    }
    EXPECT_GE(common, static_cast<int>(one.inliers.size()) - 2);
  }
}

TEST(MultiHypothesis, LambdaChoosesTheAssociatedAmongThoseThatFit)
{
  // Each point has a rival 0.4 px nearer to where the homography puts it, which is associated with it half as much.
  Rng rng(4);
  Problem problem;
  std::vector<Association> entries;
  constexpr int COUNT = 40;
  for (int i = 0; i < COUNT; ++i)
  {
    problem.reference.push_back(test::randomPixel(rng));
    problem.current.push_back(problem.reference.back() + Eigen::Vector2d(20.0, i % 2 == 0 ? 10.5 : 9.5));
    entries.push_back({ i, i, 1.0 });
  }
  for (int i = 0; i < COUNT; ++i)
  {
    problem.current.push_back(problem.reference[static_cast<std::size_t>(i)] +
                              Eigen::Vector2d(20.0, i % 2 == 0 ? 10.1 : 9.9));
    entries.push_back({ i, COUNT + i, 0.5 });
  }
  problem.association = AssociationMatrix(COUNT, 2 * COUNT, std::move(entries));
  for (const double lambda : { 0.0, 4.0 })
  {
    MultiHypothesisParams params;
    params.association_weight = lambda;
    const auto result = estimateHomography(problem.association, problem.reference, problem.current,
                                           ransacParams(2.0, 300), params, rng);
    ASSERT_EQ(static_cast<int>(result.matches.size()), COUNT);
    EXPECT_EQ(correct(result.matches), lambda > 0.0 ? COUNT : 0);
  }
}

TEST(MultiHypothesis, TheSameSeedGivesTheSame)
{
  Rng scene_rng(6);
  const Problem problem = ambiguous(false, 100, 0.35, scene_rng);
  for (const HypothesisSampling sampling : { HypothesisSampling::CANDIDATES, HypothesisSampling::IMPORTANCE })
  {
    MultiHypothesisParams params;
    params.sampling = sampling;
    std::vector<MultiHypothesisResult<FundamentalEstimator::Model>> results;
    for (int i = 0; i < 2; ++i)
    {
      Rng rng(7);
      results.push_back(estimateFundamental(problem.association, problem.reference, problem.current,
                                            ransacParams(1.0, 500), params, rng));
    }
    EXPECT_EQ(*results[0].model, *results[1].model);
    EXPECT_EQ(places(results[0].matches), places(results[1].matches));
  }
}

TEST(MultiHypothesis, ImportanceSamplingNeedsManyIterations)
{
  // Figures 9.1 and 9.4, small: few iterations find little of what many find.
  Rng scene_rng(8);
  const Problem problem = ambiguous(true, 100, 0.3, scene_rng);
  MultiHypothesisParams params;
  params.sampling = HypothesisSampling::IMPORTANCE;
  Rng rng(9);
  const auto few =
      estimateHomography(problem.association, problem.reference, problem.current, ransacParams(1.0, 3), params, rng);
  const auto many =
      estimateHomography(problem.association, problem.reference, problem.current, ransacParams(1.0, 3000), params, rng);
  EXPECT_LT(correct(few.matches), 30);
  EXPECT_GT(correct(many.matches), 85);
}

TEST(ListSampler, DrawsFromItsListOnly)
{
  Rng rng(1);
  const std::vector<int> data{ 3, 17, 5, 40, 8 };
  for (const Sampling sampling : { Sampling::UNIFORM, Sampling::PROGRESSIVE })
  {
    ListSampler sampler(sampling, data, 3, 50.0);
    std::set<int> drawn;
    std::vector<int> sample;
    for (int i = 0; i < 200; ++i)
    {
      ASSERT_TRUE(sampler.draw(rng, sample));
      ASSERT_EQ(std::set<int>(sample.begin(), sample.end()).size(), 3U);
      drawn.insert(sample.begin(), sample.end());
    }
    EXPECT_EQ(drawn, std::set<int>(data.begin(), data.end()));
    EXPECT_DOUBLE_EQ(sampler.share({ 4, 5, 8, 41 }), 0.4);
    EXPECT_EQ(sampler.replacements(), 5);
    sample = { 3, 17, 5 };
    EXPECT_FALSE(sampler.replace(rng, 1, 0, sample));  // is there already
    EXPECT_TRUE(sampler.replace(rng, 3, 1, sample));
    EXPECT_EQ(sample, (std::vector<int>{ 3, 40, 5 }));
  }
  ListSampler small(Sampling::UNIFORM, { 1, 2 }, 3, 50.0);
  std::vector<int> sample;
  EXPECT_FALSE(small.draw(rng, sample));
}

TEST(ImportanceSampler, DrawsByWeightAndSharesNoRowOrColumn)
{
  // The first row's entries weigh 1, 2 and 3; the others are alone in their rows and columns.
  const AssociationMatrix association(
      3, 5, { { 0, 0, 1.0 }, { 0, 1, 2.0 }, { 0, 2, 3.0 }, { 1, 3, 1.0 }, { 2, 4, 2.0 }, { 2, 0, 4.0 } });
  ImportanceSampler single(association, 1, 10);
  Rng rng(2);
  std::vector<int> counts(association.entries().size(), 0);
  std::vector<int> sample;
  constexpr int DRAWS = 26000;
  for (int i = 0; i < DRAWS; ++i)
  {
    ASSERT_TRUE(single.draw(rng, sample));
    ++counts[static_cast<std::size_t>(sample[0])];
  }
  for (std::size_t e = 0; e < counts.size(); ++e)
  {
    EXPECT_NEAR(counts[e], DRAWS * association.entries()[e].weight / 13.0, 300.0) << e;
  }
  EXPECT_DOUBLE_EQ(single.share({ 1, 3 }), 3.0 / 13.0);

  ImportanceSampler three(association, 3, 10);
  for (int i = 0; i < 500; ++i)
  {
    ASSERT_TRUE(three.draw(rng, sample));
    std::set<int> rows;
    std::set<int> columns;
    for (const int e : sample)
    {
      rows.insert(association.entries()[static_cast<std::size_t>(e)].row);
      columns.insert(association.entries()[static_cast<std::size_t>(e)].column);
    }
    ASSERT_EQ(rows.size(), 3U);
    ASSERT_EQ(columns.size(), 3U);
    const std::vector<int> before = sample;
    if (three.replace(rng, 0, 1, sample))
    {
      EXPECT_EQ(sample[0], before[0]);
      EXPECT_EQ(sample[2], before[2]);
      EXPECT_NE(sample[1], before[1]);
    }
  }
  ImportanceSampler four(association, 4, 10);
  EXPECT_FALSE(four.draw(rng, sample));  // there are three rows
}

TEST(ImportanceSampler, BeginsAnewWhereTheFirstLeavesNoPlace)
{
  const AssociationMatrix association(2, 2, { { 0, 0, 20.0 }, { 0, 1, 1.0 }, { 1, 0, 1.0 } });
  ImportanceSampler sampler(association, 2, 10);
  Rng rng(3);
  std::vector<int> sample;
  for (int i = 0; i < 50; ++i)
  {
    ASSERT_TRUE(sampler.draw(rng, sample)) << i;
    EXPECT_EQ(sample[0] + sample[1], 3) << "both entries that share nothing";
  }
}

}  // namespace view_servo
