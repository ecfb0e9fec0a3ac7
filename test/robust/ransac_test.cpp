// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/ransac.h"

#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"

#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

namespace view_servo
{
namespace
{
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr double INFINITE = std::numeric_limits<double>::infinity();

/** A line through two points, n^T x = c with unit n; counts what it is asked. */
class LineEstimator
{
public:
  struct Model
  {
    Eigen::Vector2d normal;
    double offset;
  };
  static constexpr int SAMPLE_SIZE = 2;

  explicit LineEstimator(const Points& points) : points_(points)
  {
  }

  std::size_t size() const
  {
    return points_.size();
  }

  bool accepts(const std::vector<int>& sample) const
  {
    return acceptance(sample);
  }

  void solve(const std::vector<int>& sample, std::vector<Model>& models) const
  {
    samples.push_back(sample);
    const Eigen::Vector2d d = points_[sample[1]] - points_[sample[0]];
    if (d.norm() > 0.0)
    {
      const Eigen::Vector2d normal = Eigen::Vector2d(-d.y(), d.x()).normalized();
      models.push_back({ normal, normal.dot(points_[sample[0]]) });
    }
  }

  double error(const Model& model, std::size_t i) const
  {
    const double distance = model.normal.dot(points_[i]) - model.offset;
    return distance * distance;
  }

  /** Total least squares. */
  std::optional<Model> refit(const Model& /*model*/, const std::vector<int>& inliers) const
  {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const int i : inliers)
    {
      centre += points_[i] / static_cast<double>(inliers.size());
    }
    double xx = 0.0;
    double xy = 0.0;
    double yy = 0.0;
    for (const int i : inliers)
    {
      const Eigen::Vector2d d = points_[i] - centre;
      xx += d.x() * d.x();
      xy += d.x() * d.y();
      yy += d.y() * d.y();
    }
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
    const Eigen::Vector2d normal(-std::sin(angle), std::cos(angle));
    return Model{ normal, normal.dot(centre) };
  }

  bool (*acceptance)(const std::vector<int>&) = [](const std::vector<int>&) {
    return true;
  };
  mutable std::vector<std::vector<int>> samples;  ///< all that were solved

private:
  const Points& points_;
};

/** Points within `noise` (deviation) of y = 0.5 x + 40 first, then points all over a 640 x 480 image. */
Points linePoints(int inliers, int outliers, double noise, std::uint64_t seed)
{
  Rng rng(seed);
  Points points;
  for (int i = 0; i < inliers; ++i)
  {
    const double x = uniform(rng, 0.0, 640.0);
    points.emplace_back(x, 0.5 * x + 40.0 + noise * gaussian(rng));
  }
  for (int i = 0; i < outliers; ++i)
  {
    points.push_back(test::randomPixel(rng));
  }
  return points;
}

RansacParams uniformParams()
{
  RansacParams params;
  params.sampling = Sampling::UNIFORM;
  return params;
}

test::Scene makeScene(bool planar, int inliers, int outliers, double noise, std::uint64_t seed, bool shuffle = true)
{
  Rng rng(seed);
  test::SceneOptions options;
  options.planar = planar;
  options.inliers = inliers;
  options.outliers = outliers;
  options.noise = noise;
  options.shuffle = shuffle;
  return test::makeScene(options, rng);
}

int trueInliers(const std::vector<int>& inliers, const test::Scene& scene)
{
  return static_cast<int>(
      std::count_if(inliers.begin(), inliers.end(), [&](int i) { return static_cast<bool>(scene.is_inlier[i]); }));
}

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

TEST(Ransac, SameSeedSameResult)
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

TEST(Ransac, ExactlyOneSampleOfData)
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

template <typename Estimator>
void expectLocalOptimizationImproves(bool planar)
{
  double plain_cost = 0.0;
  double optimized_cost = 0.0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(planar, 100, 100, 1.0, seed);
    const Estimator estimator(scene.pairs);
    RansacParams params = uniformParams();
    params.min_iterations = params.max_iterations = 300;
    params.local_optimizations = 0;
    Rng plain_rng(seed);
    const auto plain = ransac(estimator, params, plain_rng);
    params.local_optimizations = 10;
    Rng optimized_rng(seed);
    const auto optimized = ransac(estimator, params, optimized_rng);
    EXPECT_EQ(plain.statistics.local_optimizations, 0);
    EXPECT_GT(optimized.statistics.local_optimizations, 0);
    EXPECT_LE(optimized.cost, plain.cost);  // the same samples were drawn
    plain_cost += plain.cost;
    optimized_cost += optimized.cost;
  }
  EXPECT_LT(optimized_cost, 0.97 * plain_cost);
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
  double plain_cost = 0.0;
  double improved_cost = 0.0;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = makeScene(false, 100, 50, 1.0, seed);
    const FundamentalEstimator estimator(scene.pairs);
    RansacParams params = uniformParams();
    params.min_iterations = params.max_iterations = 100;
    params.local_optimizations = 0;
    Rng plain_rng(seed);
    const auto plain = ransac(estimator, params, plain_rng);
    params.improvement_stage = true;
    Rng improved_rng(seed);
    const auto improved = ransac(estimator, params, improved_rng);
    EXPECT_LE(improved.cost, plain.cost);
    EXPECT_EQ(improved.statistics.iterations, plain.statistics.iterations);
    EXPECT_GT(improved.statistics.models, plain.statistics.models + 7 * 143);
    plain_cost += plain.cost;
    improved_cost += improved.cost;
  }
  EXPECT_LT(improved_cost, 0.95 * plain_cost);
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
