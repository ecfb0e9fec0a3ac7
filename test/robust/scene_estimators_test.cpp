// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Homographies and fundamental matrices of scenes with false matches.
#include "ransac_problems.h"

#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace view_servo
{
namespace
{
// ---- estimators

TEST(HomographyEstimator, FindsThePlaneAmongOutliers)
{
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(true, 120, 180, 1.0, seed);
    Rng rng(seed);
    const auto result = ransac(HomographyEstimator(scene.pairs), uniformParams(), rng);
    ASSERT_TRUE(result.model);
    EXPECT_GE(trueInliers(result.inliers, scene), 100);
    EXPECT_LE(static_cast<int>(result.inliers.size()) - trueInliers(result.inliers, scene), 3);
    double worst = 0.0;
    for (const Correspondence& pair : makeScene(true, 120, 0, 0.0, seed).pairs)
    {
      worst = std::max(worst, (transfer(result.model->h, pair.reference) - pair.current).norm());
    }
    EXPECT_LT(worst, 2.0);
    EXPECT_LT((result.model->h * result.model->h_inverse - Eigen::Matrix3d::Identity()).norm(), 1e-8);
  }
}

RC_GTEST_PROP(HomographyEstimator, MinimalSolutionMeetsItsSample, (std::uint64_t seed))
{
  const test::Scene scene = makeScene(true, 4, 0, 0.0, seed);
  const HomographyEstimator estimator(scene.pairs);
  RC_PRE(estimator.accepts({ 0, 1, 2, 3 }));
  std::vector<HomographyEstimator::Model> models;
  estimator.solve({ 0, 1, 2, 3 }, models);
  RC_ASSERT(models.size() == 1U);
  RC_ASSERT(std::abs(models[0].h.norm() - 1.0) < 1e-12);
  for (std::size_t i = 0; i < 4; ++i)
  {
    RC_ASSERT(estimator.error(models[0], i) < 1e-14);
  }
}

TEST(HomographyEstimator, ErrorIsTheMeanOfTheTwoSquaredTransferErrors)
{
  const Correspondences pairs = { { { 10, 20 }, { 22, 40 } } };
  const Eigen::Matrix3d h = Eigen::Vector3d(2.0, 2.0, 1.0).asDiagonal();
  EXPECT_DOUBLE_EQ(HomographyEstimator(pairs).error({ h, h.inverse() }, 0), 2.5);
  EXPECT_EQ(HomographyEstimator(pairs).error({ -h, -h.inverse() }, 0), INFINITE);
}

TEST(HomographyEstimator, RefusesDegenerateAndMirroredSamples)
{
  Correspondences pairs = { { { 100, 100 }, { 120, 90 } },  { { 500, 100 }, { 480, 130 } },
                            { { 500, 400 }, { 490, 390 } }, { { 100, 400 }, { 130, 420 } },
                            { { 300, 100 }, { 300, 110 } },   // on the line of the first two
                            { { 100, 100 }, { 120, 90 } } };  // the first again
  const HomographyEstimator estimator(pairs);
  EXPECT_TRUE(estimator.accepts({ 0, 1, 2, 3 }));
  EXPECT_TRUE(estimator.accepts({ 3, 1, 0, 2 }));
  EXPECT_FALSE(estimator.accepts({ 0, 1, 2, 4 }));
  EXPECT_FALSE(estimator.accepts({ 0, 1, 2, 5 }));
  for (Correspondence& pair : pairs)
  {
    pair.current.x() *= -1.0;
  }
  EXPECT_FALSE(estimator.accepts({ 0, 1, 2, 3 }));
}

TEST(HomographyEstimator, FindsNothingInAMirroredPlane)
{
  test::Scene scene = makeScene(true, 100, 0, 0.0, 24);
  for (Correspondence& pair : scene.pairs)
  {
    pair.current.x() = test::IMAGE_WIDTH - pair.current.x();
  }
  RansacParams params;
  params.max_rejected = 2000;
  Rng rng(24);
  const auto result = ransac(HomographyEstimator(scene.pairs), params, rng);
  EXPECT_EQ(result.statistics.stop, RansacStop::REJECTION_LIMIT);
  EXPECT_FALSE(result.model);
}

TEST(HomographyEstimator, SolvesNoTwistedSample)
{
  Correspondences pairs = {
    { { 0, 0 }, { 0, 0 } }, { { 100, 0 }, { 100, 0 } }, { { 100, 100 }, { 0, 100 } }, { { 0, 100 }, { 100, 100 } }
  };
  std::vector<HomographyEstimator::Model> models;
  HomographyEstimator(pairs).solve({ 0, 1, 2, 3 }, models);
  EXPECT_TRUE(models.empty());
}

TEST(FundamentalEstimator, FindsTheGeometryAmongOutliers)
{
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(false, 180, 120, 1.0, seed);
    Rng rng(seed);
    const auto result = ransac(FundamentalEstimator(scene.pairs), uniformParams(), rng);
    ASSERT_TRUE(result.model);
    EXPECT_GE(trueInliers(result.inliers, scene), 170);
    double sum = 0.0;
    for (const Correspondence& pair : makeScene(false, 180, 0, 0.0, seed).pairs)
    {
      sum += sampsonError(*result.model, pair);
    }
    EXPECT_LT(std::sqrt(sum / 180.0), 0.7);
  }
}

TEST(FundamentalEstimator, RefitNeedsEightSpreadInliers)
{
  const test::Scene scene = makeScene(false, 20, 0, 0.5, 25);
  const FundamentalEstimator estimator(scene.pairs);
  std::vector<int> inliers(20);
  std::iota(inliers.begin(), inliers.end(), 0);
  EXPECT_TRUE(estimator.refit(scene.fundamental, inliers));
  inliers.resize(7);
  EXPECT_FALSE(estimator.refit(scene.fundamental, inliers));
  EXPECT_FALSE(estimator.refit(scene.fundamental, std::vector<int>(20, 3)));
}

TEST(FundamentalEstimator, ViewConsistencyRefusesMostBadSamplesAndFewGoodOnes)
{
  // A distant scene is nearly scaled-orthographic, as the constraint assumes.
  Rng rng(26);
  Correspondences pairs = test::scaledOrthographicPairs(100, rng);
  for (int i = 0; i < 100; ++i)
  {
    const Eigen::Vector2d reference = test::randomPixel(rng);
    pairs.push_back({ reference, test::randomPixel(rng) });
  }
  const FundamentalEstimator without(pairs);
  const FundamentalEstimator with(pairs, 0.03);
  int good = 0;
  int bad = 0;
  std::vector<int> sample;
  for (int i = 0; i < 500; ++i)
  {
    detail::drawDistinct(rng, 100, 7, sample);
    EXPECT_TRUE(without.accepts(sample));
    good += with.accepts(sample) ? 1 : 0;
    for (int& index : sample)
    {
      index += 100;
    }
    EXPECT_TRUE(without.accepts(sample));
    bad += with.accepts(sample) ? 1 : 0;
  }
  EXPECT_EQ(good, 500);
  EXPECT_LT(bad, 50);
}

TEST(FundamentalEstimator, ViewConsistencyTestsTheFirstAndTheLastFive)
{
  Rng rng(27);
  const Correspondences exact = test::scaledOrthographicPairs(7, rng);
  const std::vector<int> sample = { 0, 1, 2, 3, 4, 5, 6 };
  EXPECT_TRUE(FundamentalEstimator(exact, 0.01).accepts(sample));
  for (const int moved : { 0, 6 })
  {
    Correspondences pairs = exact;
    pairs[moved].current += Eigen::Vector2d(80.0, -120.0);
    EXPECT_FALSE(FundamentalEstimator(pairs, 0.01).accepts(sample)) << moved;
  }
}

TEST(FundamentalEstimator, ViewConsistencyFindsTheGeometryWithFewerSolvedSamples)
{
  int with = 0;
  int without = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(false, 90, 210, 0.5, seed);
    RansacParams params = uniformParams();
    params.min_iterations = params.max_iterations = 300;
    Rng rng(seed);
    const auto plain = ransac(FundamentalEstimator(scene.pairs), params, rng);
    const auto consistent = ransac(FundamentalEstimator(scene.pairs, 0.1), params, rng);
    EXPECT_EQ(plain.statistics.rejected_samples, 0);
    EXPECT_GT(consistent.statistics.rejected_samples, 300);
    without += trueInliers(plain.inliers, scene);
    with += trueInliers(consistent.inliers, scene);
  }
  EXPECT_GT(with, without + 100);
}

}  // namespace
}  // namespace view_servo
