// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// The loop, its local optimisation and its improvement stage.
#include "ransac_problems.h"

#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <vector>

namespace view_servo
{
namespace
{
// ---- parameters

TEST(RansacParams, DefaultsAreValid)
{
  EXPECT_TRUE(RansacParams().validate().empty());
}

TEST(RansacParams, EveryFaultIsReported)
{
  const auto faults = [](auto change) {
    RansacParams params;
    change(params);
    return params.validate().size();
  };
  EXPECT_EQ(faults([](RansacParams& p) { p.inlier_threshold = 0.0; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.inlier_threshold = NOT_A_NUMBER; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.inlier_threshold = INFINITE; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.confidence = 1.0; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.confidence = 0.0; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.confidence = NOT_A_NUMBER; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.min_iterations = -1; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.max_rejected = -1; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.local_optimizations = -1; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) { p.max_iterations = 0; }), 1U);
  EXPECT_EQ(faults([](RansacParams& p) {
              p.inlier_threshold = -1.0;
              p.confidence = 2.0;
              p.max_rejected = -3;
            }),
            3U);
}

// ---- the loop

TEST(RequiredSamples, FollowsEquation95)
{
  EXPECT_NEAR(detail::requiredSamples(0.5, 4, 0.99), std::log(0.01) / std::log(1.0 - 0.0625), 1e-9);
  EXPECT_EQ(detail::requiredSamples(0.0, 4, 0.99), INFINITE);
  EXPECT_EQ(detail::requiredSamples(1.0, 4, 0.99), 0.0);
}

TEST(Ransac, SeparatesALineFromOutliers)
{
  const Points points = linePoints(60, 40, 0.5, 10);
  const LineEstimator estimator(points);
  Rng rng(10);
  const auto result = ransac(estimator, uniformParams(), rng);
  ASSERT_TRUE(result.model);
  const Eigen::Vector2d truth = Eigen::Vector2d(-0.5, 1.0).normalized();
  EXPECT_GT(std::abs(result.model->normal.dot(truth)), 0.9999);
  for (int i = 0; i < 60; ++i)
  {
    EXPECT_TRUE(std::binary_search(result.inliers.begin(), result.inliers.end(), i)) << i;
  }
  EXPECT_LT(result.inliers.size(), 65U);
}

TEST(Ransac, ReportsInliersAndCostOfItsModel)
{
  const Points points = linePoints(60, 40, 1.5, 11);
  const LineEstimator estimator(points);
  RansacParams params = uniformParams();
  params.inlier_threshold = 2.0;
  Rng rng(11);
  const auto result = ransac(estimator, params, rng);
  ASSERT_TRUE(result.model);
  std::vector<int> inliers;
  double cost = 0.0;
  for (int i = 0; i < 100; ++i)
  {
    const double error = estimator.error(*result.model, i);
    cost += std::min(error, 4.0);
    if (error <= 4.0)
    {
      inliers.push_back(i);
    }
  }
  EXPECT_EQ(result.inliers, inliers);
  EXPECT_NEAR(result.cost, cost, 1e-9);
  EXPECT_EQ(result.statistics.iterations, static_cast<int>(estimator.samples.size()));
  EXPECT_GE(result.statistics.models, result.statistics.iterations);
}

TEST(Ransac, SameSeedGivesTheSameResult)
{
  for (const bool planar : { true, false })
  {
    const test::Scene scene = makeScene(planar, 100, 100, 1.0, 12);
    const auto run = [&](const auto& estimator) {
      Rng first_rng(12);
      Rng second_rng(12);
      Rng other_rng(13);
      RansacParams params;
      params.max_iterations = 300;
      const auto first = ransac(estimator, params, first_rng);
      const auto second = ransac(estimator, params, second_rng);
      const auto other = ransac(estimator, params, other_rng);
      EXPECT_EQ(first.cost, second.cost);
      EXPECT_EQ(first.inliers, second.inliers);
      EXPECT_EQ(first.statistics.models, second.statistics.models);
      EXPECT_EQ(first.statistics.iterations, second.statistics.iterations);
      EXPECT_EQ(first_rng, second_rng);
      EXPECT_NE(first_rng, other_rng);
    };
    if (planar)
    {
      run(HomographyEstimator(scene.pairs));
    }
    else
    {
      run(FundamentalEstimator(scene.pairs));
    }
  }
}

TEST(Ransac, StopsWhenConfident)
{
  const Points points = linePoints(50, 50, 0.1, 14);
  const LineEstimator estimator(points);
  RansacParams params = uniformParams();
  params.min_iterations = 0;
  params.confidence = 0.9999;
  Rng rng(14);
  const auto result = ransac(estimator, params, rng);
  EXPECT_EQ(result.statistics.stop, RansacStop::CONFIDENCE_REACHED);
  const double ratio = static_cast<double>(result.inliers.size()) / 100.0;
  EXPECT_EQ(result.statistics.iterations, std::ceil(detail::requiredSamples(ratio, 2, params.confidence)));

  params.min_iterations = 150;
  EXPECT_EQ(ransac(estimator, params, rng).statistics.iterations, 150);
}

TEST(Ransac, StopsAtTheIterationLimit)
{
  const Points points = linePoints(5, 95, 0.1, 15);
  const LineEstimator estimator(points);
  RansacParams params = uniformParams();
  params.min_iterations = 0;
  params.max_iterations = 70;
  Rng rng(15);
  const auto result = ransac(estimator, params, rng);
  EXPECT_EQ(result.statistics.stop, RansacStop::ITERATION_LIMIT);
  EXPECT_EQ(result.statistics.iterations, 70);
  EXPECT_TRUE(result.model);
}

TEST(Ransac, TooFewDataGiveNoModel)
{
  Rng rng(16);
  const Points one = linePoints(1, 0, 0.0, 16);
  const auto result = ransac(LineEstimator(one), RansacParams(), rng);
  EXPECT_EQ(result.statistics.stop, RansacStop::TOO_FEW_DATA);
  EXPECT_FALSE(result.model);
  EXPECT_TRUE(result.inliers.empty());
  EXPECT_EQ(result.statistics.iterations, 0);

  const test::Scene scene = makeScene(false, 6, 0, 0.0, 16);
  EXPECT_EQ(ransac(FundamentalEstimator(scene.pairs), RansacParams(), rng).statistics.stop, RansacStop::TOO_FEW_DATA);
  const Correspondences none;
  EXPECT_EQ(ransac(HomographyEstimator(none), RansacParams(), rng).statistics.stop, RansacStop::TOO_FEW_DATA);
}

TEST(Ransac, ExactlyOneSampleOfDataSuffices)
{
  Rng rng(17);
  const test::Scene plane = makeScene(true, 4, 0, 0.0, 21);
  const auto h = ransac(HomographyEstimator(plane.pairs), RansacParams(), rng);
  ASSERT_TRUE(h.model);
  EXPECT_EQ(h.inliers.size(), 4U);
  const test::Scene scene = makeScene(false, 7, 0, 0.0, 17);
  const auto f = ransac(FundamentalEstimator(scene.pairs), RansacParams(), rng);
  ASSERT_TRUE(f.model);
  EXPECT_EQ(f.inliers.size(), 7U);
}

TEST(Ransac, CoincidingDataEndWithoutAModel)
{
  const Points points(50, Eigen::Vector2d(10.0, 20.0));
  const Correspondences pairs(50, Correspondence{ { 10, 20 }, { 30, 40 } });
  for (const Sampling sampling : { Sampling::UNIFORM, Sampling::PROGRESSIVE })
  {
    RansacParams params;
    params.sampling = sampling;
    params.improvement_stage = true;
    params.max_rejected = 1000;
    Rng rng(18);
    const auto line = ransac(LineEstimator(points), params, rng);
    EXPECT_FALSE(line.model);
    EXPECT_EQ(line.statistics.stop, RansacStop::ITERATION_LIMIT);
    EXPECT_EQ(line.statistics.iterations, params.max_iterations);
    EXPECT_DOUBLE_EQ(line.cost, 50 * 9.0);

    const auto f = ransac(FundamentalEstimator(pairs), params, rng);
    EXPECT_FALSE(f.model);
    EXPECT_EQ(f.statistics.stop, RansacStop::ITERATION_LIMIT);

    const auto h = ransac(HomographyEstimator(pairs), params, rng);
    EXPECT_FALSE(h.model);
    EXPECT_EQ(h.statistics.stop, RansacStop::REJECTION_LIMIT);
    EXPECT_EQ(h.statistics.rejected_samples, 1001);  // the first above the limit ends it
    EXPECT_EQ(h.statistics.iterations, 0);
  }
}

TEST(Ransac, RefusedSamplesAreCountedAndNotSolved)
{
  const Points points = linePoints(50, 50, 0.1, 19);
  LineEstimator estimator(points);
  estimator.acceptance = [](const std::vector<int>& sample) {
    return (sample[0] + sample[1]) % 2 == 0;
  };
  RansacParams params = uniformParams();
  params.min_iterations = params.max_iterations = 400;
  Rng rng(19);
  const auto result = ransac(estimator, params, rng);
  EXPECT_EQ(result.statistics.iterations, 400);
  EXPECT_EQ(estimator.samples.size(), 400U);
  EXPECT_NEAR(result.statistics.rejected_samples, 400, 100);
  for (const auto& sample : estimator.samples)
  {
    EXPECT_EQ((sample[0] + sample[1]) % 2, 0);
  }

  params.max_rejected = 0;
  EXPECT_EQ(ransac(estimator, params, rng).statistics.stop, RansacStop::REJECTION_LIMIT);
}

TEST(Ransac, InvalidDataAreOutliers)
{
  test::Scene scene = makeScene(true, 100, 0, 0.5, 20);
  for (int i = 0; i < 30; ++i)
  {
    const double invalid = i % 2 == 0 ? NOT_A_NUMBER : INFINITE;
    (i % 3 == 0 ? scene.pairs[i].reference : scene.pairs[i].current).x() = invalid;
  }
  Rng rng(20);
  const auto h = ransac(HomographyEstimator(scene.pairs), uniformParams(), rng);
  ASSERT_TRUE(h.model);
  EXPECT_TRUE(h.model->h.allFinite());
  EXPECT_EQ(h.inliers.size(), 70U);
  EXPECT_EQ(h.inliers.front(), 30);
  EXPECT_TRUE(std::isfinite(h.cost));

  test::Scene general = makeScene(false, 100, 0, 0.5, 20);
  for (int i = 0; i < 30; ++i)
  {
    general.pairs[i].current.y() = i % 2 == 0 ? NOT_A_NUMBER : INFINITE;
  }
  const auto f = ransac(FundamentalEstimator(general.pairs), uniformParams(), rng);
  ASSERT_TRUE(f.model);
  EXPECT_TRUE(f.model->allFinite());
  EXPECT_EQ(f.inliers.size(), 70U);
}

TEST(SequentialTest, KeepsModelsAsGoodAsTheBestAndDropsBadOnes)
{
  Rng rng(21);
  for (const double ratio : { 0.1, 0.3, 0.6, 0.9 })
  {
    detail::SequentialTest test;
    test.setBest(ratio);
    const auto failures = [&](double inlier_ratio) {
      int failed = 0;
      for (int run = 0; run < 2000; ++run)
      {
        double evidence = 0.0;
        bool fails = false;
        for (int i = 0; i < 500 && !fails; ++i)
        {
          test.add(uniform(rng, 0.0, 1.0) < inlier_ratio, evidence);
          fails = detail::SequentialTest::fails(evidence);
        }
        failed += fails ? 1 : 0;
      }
      return failed;
    };
    EXPECT_LE(failures(ratio), 3);  // expected at most 0.2
    EXPECT_GE(failures(0.1 * ratio), 1900);
  }
}

TEST(SequentialTest, FailsNothingWithoutABest)
{
  const detail::SequentialTest test;
  double evidence = 0.0;
  for (int i = 0; i < 1000; ++i)
  {
    test.add(false, evidence);
  }
  EXPECT_FALSE(detail::SequentialTest::fails(evidence));
}

// ---- local optimisation and the improvement stage

/**
 * Searches ten scenes twice, the second time with other parameters; the same samples are drawn.
 * @param change void(RansacParams&). @param check void(const Result& before, const Result& after).
 * @return the sum of the costs after the change, divided by that before.
 */
template <typename Estimator, typename Change, typename Check>
double costRatio(bool planar, int wrong, int iterations, const Change& change, const Check& check)
{
  double before_cost = 0.0;
  double after_cost = 0.0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(planar, 100, wrong, 1.0, seed);
    const Estimator estimator(scene.pairs);
    RansacParams params = uniformParams();
    params.min_iterations = params.max_iterations = iterations;
    params.local_optimizations = 0;
    Rng rng(seed);
    const auto before = ransac(estimator, params, rng);
    change(params);
    Rng same_rng(seed);
    const auto after = ransac(estimator, params, same_rng);
    EXPECT_LE(after.cost, before.cost);
    check(before, after);
    before_cost += before.cost;
    after_cost += after.cost;
  }
  return after_cost / before_cost;
}

template <typename Estimator>
void expectLocalOptimizationImproves(bool planar)
{
  const auto check = [](const auto& plain, const auto& optimized) {
    EXPECT_EQ(plain.statistics.local_optimizations, 0);
    EXPECT_GT(optimized.statistics.local_optimizations, 0);
  };
  const auto change = [](RansacParams& params) {
    params.local_optimizations = 10;
  };
  EXPECT_LT(costRatio<Estimator>(planar, 100, 300, change, check), 0.97);
}

TEST(Ransac, LocalOptimizationImprovesHomographies)
{
  expectLocalOptimizationImproves<HomographyEstimator>(true);
}

TEST(Ransac, LocalOptimizationImprovesFundamentalMatrices)
{
  expectLocalOptimizationImproves<FundamentalEstimator>(false);
}

TEST(Ransac, LocalOptimizationSavesSamples)
{
  // A better model has more inliers, so that eq. 9.5 stops earlier.
  int plain = 0;
  int optimized = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(false, 120, 80, 1.0, seed);
    const FundamentalEstimator estimator(scene.pairs);
    RansacParams params = uniformParams();
    params.min_iterations = 0;
    params.local_optimizations = 0;
    Rng rng(seed);
    plain += ransac(estimator, params, rng).statistics.iterations;
    params.local_optimizations = 10;
    optimized += ransac(estimator, params, rng).statistics.iterations;
  }
  EXPECT_LT(optimized, plain);
}

TEST(Ransac, ImprovementStageImproves)
{
  const auto check = [](const auto& plain, const auto& improved) {
    EXPECT_EQ(improved.statistics.iterations, plain.statistics.iterations);
    EXPECT_GT(improved.statistics.models, plain.statistics.models + 7 * 143);
  };
  const auto change = [](RansacParams& params) {
    params.improvement_stage = true;
  };
  EXPECT_LT(costRatio<FundamentalEstimator>(false, 50, 100, change, check), 0.95);
}

TEST(Ransac, ImprovementStageReplacesOneDatumAtATime)
{
  const Points points = linePoints(30, 0, 1.0, 22);
  const LineEstimator estimator(points);
  RansacParams params = uniformParams();
  params.min_iterations = params.max_iterations = 1;
  params.local_optimizations = 0;
  params.improvement_stage = true;
  Rng rng(22);
  const auto result = ransac(estimator, params, rng);
  EXPECT_EQ(result.statistics.iterations, 1);
  // One random sample, then each of two positions takes each of the (30 - 2) others, or 27 where one was just kept.
  EXPECT_GE(estimator.samples.size(), 1U + 2U * 27U);
  EXPECT_LE(estimator.samples.size(), 1U + 2U * 29U);
  for (const auto& sample : estimator.samples)
  {
    EXPECT_NE(sample[0], sample[1]);
  }
}

TEST(Ransac, ImprovementStageRespectsTheRejectionLimit)
{
  // Only the pairs that contain datum 0 are accepted: replacing it is refused 28 times or more.
  const Points points = linePoints(30, 0, 1.0, 23);
  LineEstimator estimator(points);
  estimator.acceptance = [](const std::vector<int>& sample) {
    return sample[0] * sample[1] == 0;
  };
  RansacParams params = uniformParams();
  params.min_iterations = params.max_iterations = 1;
  params.improvement_stage = true;
  Rng rng(23);
  const auto unlimited = ransac(estimator, params, rng);
  EXPECT_GE(unlimited.statistics.rejected_samples, 28);
  params.max_rejected = unlimited.statistics.rejected_samples - 10;
  Rng same_rng(23);
  const auto limited = ransac(estimator, params, same_rng);
  EXPECT_EQ(limited.statistics.rejected_samples, params.max_rejected + 1);
  EXPECT_TRUE(limited.model);
}

}  // namespace
}  // namespace view_servo
