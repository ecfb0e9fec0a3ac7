// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/numbers.h"

#include "../../src/geometry/residuals.h"
#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
double totalSampsonError(const Eigen::Matrix3d& f, const Correspondences& pairs)
{
  double sum = 0.0;
  for (const Correspondence& pair : pairs)
  {
    sum += sampsonError(f, pair);
  }
  return sum;
}

/** RMS Sampson distance of noise-free pairs of the same scene [px]. */
double rmsDistance(const Eigen::Matrix3d& f, const test::Scene& scene)
{
  Rng rng(99);
  Correspondences pairs;
  const Eigen::Matrix3d k_inverse = scene.k.inverse();
  while (pairs.size() < 200)
  {
    const Eigen::Vector2d reference = test::randomPixel(rng);
    const Eigen::Vector3d x = uniform(rng, 3.0, 6.0) * (k_inverse * reference.homogeneous());
    pairs.push_back({ reference, (scene.k * (scene.r * x + scene.t)).hnormalized() });
  }
  return std::sqrt(totalSampsonError(f, pairs) / static_cast<double>(pairs.size()));
}

double nearest(const std::vector<Eigen::Matrix3d>& solutions, const Eigen::Matrix3d& truth)
{
  double best = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& f : solutions)
  {
    best = std::min(best, test::projectiveDistance(f, truth));
  }
  return best;
}

Correspondences collinear(int count)
{
  Correspondences pairs;
  for (int i = 0; i < count; ++i)
  {
    pairs.push_back({ { 10.0 + 20.0 * i, 30.0 + 7.0 * i }, { 50.0 + 11.0 * i, 400.0 - 9.0 * i * (1.0 + 0.01 * i) } });
  }
  return pairs;
}

TEST(SampsonError, OfASidewaysTranslationIsHalfTheSquaredRowDifference)
{
  Eigen::Matrix3d f;
  f << 0, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_DOUBLE_EQ(sampsonError(f, { { 100, 50 }, { 300, 53 } }), 4.5);
  EXPECT_DOUBLE_EQ(sampsonError(-7.0 * f, { { 100, 50 }, { 300, 53 } }), 4.5);
  EXPECT_DOUBLE_EQ(sampsonError(f, { { 100, 50 }, { 300, 50 } }), 0.0);
}

TEST(SampsonError, IsTheSquareOfTheResidual)
{
  const test::Scene scene = test::makeScene(50, 3.0, 1);
  for (const Correspondence& pair : scene.pairs)
  {
    Eigen::Matrix<double, 1, 9> jacobian;
    const double residual = sampsonResidual(scene.fundamental, pair, jacobian);
    EXPECT_NEAR(sampsonError(scene.fundamental, pair), residual * residual, 1e-9);
  }
}

TEST(SampsonError, ApproximatesTheDistanceToAnExactPair)
{
  // Moving a current point off its epipolar line by s costs at most s (the reference point may share the correction).
  const test::Scene scene = test::makeScene(50, 0.0, 2);
  for (const Correspondence& exact : scene.pairs)
  {
    const Eigen::Vector3d line = scene.fundamental * exact.reference.homogeneous();
    Correspondence pair = exact;
    pair.current += 2.0 * line.head<2>().normalized();
    EXPECT_LT(sampsonError(scene.fundamental, pair), 4.0);
    EXPECT_GT(sampsonError(scene.fundamental, pair), 1.0);
  }
}

TEST(SampsonError, InfiniteWhereUndefined)
{
  Eigen::Matrix3d f;  // pure forward motion: both epipoles at (0, 0)
  f << 0, -1, 0, 1, 0, 0, 0, 0, 0;
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sampsonError(f, { { 0, 0 }, { 0, 0 } }), infinite);
  EXPECT_EQ(sampsonError(f, { { NOT_A_NUMBER, 0 }, { 3, 4 } }), infinite);
}

RC_GTEST_PROP(FundamentalFromSevenPoints, OneOrThreeSolutionsWithTheTruthAmongThem, (std::uint64_t seed))
{
  const test::Scene scene = test::makeScene(7, 0.0, seed);
  const auto solutions = fundamentalFromSevenPoints(scene.pairs);
  RC_ASSERT(solutions.size() == 1 || solutions.size() == 3);
  for (const Eigen::Matrix3d& f : solutions)
  {
    RC_ASSERT(std::abs(f.norm() - 1.0) < 1e-12);
    RC_ASSERT(totalSampsonError(f, scene.pairs) < 1e-12);
    RC_ASSERT(f.jacobiSvd().singularValues()(2) < 1e-12);
  }
  RC_ASSERT(nearest(solutions, scene.fundamental) < 1e-6);
}

TEST(FundamentalFromSevenPoints, UsuallyMeetsTheTruthToEightDigits)
{
  int one = 0;
  int three = 0;
  int exact = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed)
  {
    const test::Scene scene = test::makeScene(7, 0.0, seed);
    const auto solutions = fundamentalFromSevenPoints(scene.pairs);
    one += solutions.size() == 1 ? 1 : 0;
    three += solutions.size() == 3 ? 1 : 0;
    exact += nearest(solutions, scene.fundamental) < 1e-8 ? 1 : 0;
  }
  EXPECT_EQ(one + three, 200);
  EXPECT_GT(one, 10);
  EXPECT_GT(three, 10);
  EXPECT_GE(exact, 195);
}

TEST(FundamentalFromSevenPoints, FindsASolutionThatIsADirectionOfThePencil)
{
  // Sideways translation, with points that leave a symmetric pencil.
  Correspondences pairs;
  Rng rng(5);
  for (int i = 0; i < 7; ++i)
  {
    const Eigen::Vector2d p = test::randomPixel(rng);
    pairs.push_back({ p, { p.x() + uniform(rng, 5.0, 60.0), p.y() } });
  }
  Eigen::Matrix3d truth;
  truth << 0, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_LT(nearest(fundamentalFromSevenPoints(pairs), truth), 1e-8);
}

TEST(FundamentalFromSevenPoints, EmptyWhenThePencilIsNotDetermined)
{
  const test::Scene scene = test::makeScene(8, 0.0, 6);
  EXPECT_TRUE(fundamentalFromSevenPoints(scene.pairs).empty());
  EXPECT_TRUE(fundamentalFromSevenPoints({}).empty());
  EXPECT_TRUE(fundamentalFromSevenPoints(test::makeScene(7, 0.0, 6, true).pairs).empty());
  EXPECT_TRUE(fundamentalFromSevenPoints(collinear(7)).empty());
  EXPECT_TRUE(fundamentalFromSevenPoints(Correspondences(7, scene.pairs[0])).empty());
  Correspondences twice(scene.pairs.begin(), scene.pairs.begin() + 7);
  twice[6] = twice[2];
  EXPECT_TRUE(fundamentalFromSevenPoints(twice).empty());
  twice[6].current.x() = NOT_A_NUMBER;
  EXPECT_TRUE(fundamentalFromSevenPoints(twice).empty());
}

RC_GTEST_PROP(FundamentalFromPoints, ExactDataGiveTheTruth, (std::uint64_t seed))
{
  const int points = *rc::gen::inRange(12, 60);
  const test::Scene scene = test::makeScene(points, 0.0, seed);
  const auto f = fundamentalFromPoints(scene.pairs);
  RC_ASSERT(f.has_value());
  RC_ASSERT(std::abs(f->norm() - 1.0) < 1e-12);
  RC_ASSERT(std::abs(f->determinant()) < 1e-15);
  RC_ASSERT(test::projectiveDistance(*f, scene.fundamental) < 1e-8);
}

TEST(FundamentalFromPoints, EightPointsSuffice)
{
  for (std::uint64_t seed = 0; seed < 20; ++seed)
  {
    const test::Scene scene = test::makeScene(8, 0.0, seed);
    const auto f = fundamentalFromPoints(scene.pairs);
    ASSERT_TRUE(f);
    EXPECT_LT(test::projectiveDistance(*f, scene.fundamental), 1e-6);
  }
}

TEST(FundamentalFromPoints, EmptyForTooFewOrDegeneratePoints)
{
  EXPECT_FALSE(fundamentalFromPoints(test::makeScene(7, 0.0, 1).pairs));
  EXPECT_FALSE(fundamentalFromPoints(test::makeScene(8, 0.0, 1, true).pairs));
  EXPECT_FALSE(fundamentalFromPoints(test::makeScene(100, 0.0, 2, true).pairs));
  EXPECT_FALSE(fundamentalFromPoints(collinear(20)));
  EXPECT_FALSE(fundamentalFromPoints(Correspondences(20, test::makeScene(1, 0.0, 1).pairs[0])));
  Correspondences repeated = test::makeScene(7, 0.0, 3).pairs;
  repeated.insert(repeated.end(), repeated.begin(), repeated.end());
  EXPECT_FALSE(fundamentalFromPoints(repeated));
  Correspondences invalid = test::makeScene(20, 0.0, 3).pairs;
  invalid[4].reference.y() = NOT_A_NUMBER;
  EXPECT_FALSE(fundamentalFromPoints(invalid));
}

RC_GTEST_PROP(SampsonResidual, JacobianMatchesNumericOne, (std::uint64_t seed))
{
  constexpr double STEP = 1e-6;
  const test::Scene scene = test::makeScene(1, 5.0, seed);
  const Normalization unit{ { 320.0, 240.0 }, 0.005 };
  const Correspondence pair = { unit(scene.pairs[0].reference), unit(scene.pairs[0].current) };
  const Eigen::Matrix3d f = (unit.inverseMatrix().transpose() * scene.fundamental * unit.inverseMatrix()).normalized();
  Eigen::Matrix<double, 1, 9> jacobian;
  Eigen::Matrix<double, 1, 9> unused;
  sampsonResidual(f, pair, jacobian);
  for (int k = 0; k < 9; ++k)
  {
    Eigen::Matrix3d plus = f;
    Eigen::Matrix3d minus = f;
    plus(k / 3, k % 3) += STEP;
    minus(k / 3, k % 3) -= STEP;
    const double numeric = (sampsonResidual(plus, pair, unused) - sampsonResidual(minus, pair, unused)) / (2.0 * STEP);
    RC_ASSERT(std::abs(jacobian(k) - numeric) < 1e-5 * (1.0 + std::abs(numeric)));
  }
}

RC_GTEST_PROP(Orthonormal, RepresentsAnyMatrixOfRankTwo, (std::uint64_t seed))
{
  const test::Scene scene = test::makeScene(1, 0.0, seed);
  const Orthonormal orthonormal(scene.fundamental);
  RC_ASSERT(std::abs(orthonormal.u.determinant() - 1.0) < 1e-12);
  RC_ASSERT(std::abs(orthonormal.v.determinant() - 1.0) < 1e-12);
  RC_ASSERT((orthonormal.matrix() - scene.fundamental).norm() < 1e-12);
}

RC_GTEST_PROP(Orthonormal, DerivativesMatchNumericOnes, (std::uint64_t seed))
{
  constexpr double STEP = 1e-6;
  Rng rng(seed);
  Eigen::Matrix3d any;
  for (int i = 0; i < 9; ++i)
  {
    any(i / 3, i % 3) = gaussian(rng);
  }
  const Orthonormal orthonormal(any);
  const Matrix9x7d derivatives = orthonormal.derivatives();
  for (int k = 0; k < 7; ++k)
  {
    const Vector7d step = STEP * Vector7d::Unit(k);
    const Vector9d numeric =
        rowMajor(orthonormal.moved(step).matrix() - orthonormal.moved(-step).matrix()) / (2.0 * STEP);
    RC_ASSERT((derivatives.col(k) - numeric).norm() < 1e-8);
  }
}

TEST(RefineFundamental, LowersTheErrorAndGetsNearTheTruth)
{
  for (std::uint64_t seed = 0; seed < 20; ++seed)
  {
    const test::Scene scene = test::makeScene(100, 1.0, seed);
    const auto linear = fundamentalFromPoints(scene.pairs);
    ASSERT_TRUE(linear);
    const Eigen::Matrix3d refined = refineFundamental(*linear, scene.pairs);
    const double error = totalSampsonError(refined, scene.pairs);
    EXPECT_LT(error, totalSampsonError(*linear, scene.pairs));
    EXPECT_LT(error, totalSampsonError(scene.fundamental, scene.pairs));
    EXPECT_LT(rmsDistance(refined, scene), 0.7);
    EXPECT_NEAR(refined.norm(), 1.0, 1e-12);
    EXPECT_LT(std::abs(refined.determinant()), 1e-15);
  }
}

TEST(RefineFundamental, NoNearbyMatrixOfRankTwoIsBetter)
{
  Rng rng(12);
  const test::Scene scene = test::makeScene(60, 1.0, 12);
  const Eigen::Matrix3d refined =
      refineFundamental(*fundamentalFromPoints(scene.pairs), scene.pairs, std::numeric_limits<double>::infinity(), 100);
  const double error = totalSampsonError(refined, scene.pairs);
  for (int i = 0; i < 100; ++i)
  {
    Vector7d step;
    for (int k = 0; k < 7; ++k)
    {
      step(k) = 1e-5 * gaussian(rng);
    }
    EXPECT_GT(totalSampsonError(Orthonormal(refined).moved(step).matrix(), scene.pairs), error);
  }
}

TEST(RefineFundamental, HuberWidthResistsOutliers)
{
  test::Scene scene = test::makeScene(100, 0.5, 13);
  for (int i = 0; i < 10; ++i)
  {
    const Eigen::Vector3d line = scene.fundamental * scene.pairs[i].reference.homogeneous();
    scene.pairs[i].current += 40.0 * line.head<2>().normalized();
  }
  const Eigen::Matrix3d plain = refineFundamental(scene.fundamental, scene.pairs);
  const Eigen::Matrix3d robust = refineFundamental(scene.fundamental, scene.pairs, 1.0);
  EXPECT_LT(rmsDistance(robust, scene), 0.7);
  EXPECT_GT(rmsDistance(plain, scene), 2.0);
}

TEST(RefineFundamental, InvalidPairsAreLeftOut)
{
  const test::Scene scene = test::makeScene(50, 0.5, 14);
  const Eigen::Matrix3d linear = *fundamentalFromPoints(scene.pairs);
  Correspondences pairs = scene.pairs;
  pairs.push_back({ { 10, NOT_A_NUMBER }, { 3, 4 } });
  EXPECT_EQ(refineFundamental(linear, pairs), refineFundamental(linear, scene.pairs));
}

TEST(RefineFundamental, ReturnsTheInitialWhenItCannotBeImproved)
{
  const test::Scene scene = test::makeScene(20, 0.5, 15);
  const Eigen::Matrix3d initial = 2.0 * scene.fundamental;
  EXPECT_EQ(refineFundamental(initial, {}), initial);
  EXPECT_EQ(refineFundamental(initial, { scene.pairs.begin(), scene.pairs.begin() + 6 }), initial);
  EXPECT_EQ(refineFundamental(initial, Correspondences(20, scene.pairs[0])), initial);
  EXPECT_EQ(refineFundamental(initial, scene.pairs, 1.0, 0), initial);
}

RC_GTEST_PROP(Epipoles, AreTheOtherCamerasCentre, (std::uint64_t seed))
{
  const test::Scene scene = test::makeScene(1, 0.0, seed);
  const Eigen::Vector3d current = (scene.k * scene.t).normalized();
  const Eigen::Vector3d reference = (scene.k * scene.r.transpose() * scene.t).normalized();
  RC_ASSERT(currentEpipole(scene.fundamental).cross(current).norm() < 1e-9);
  RC_ASSERT(referenceEpipole(scene.fundamental).cross(reference).norm() < 1e-9);
  RC_ASSERT(std::abs(currentEpipole(scene.fundamental).norm() - 1.0) < 1e-12);
  RC_ASSERT(std::abs(referenceEpipole(scene.fundamental).norm() - 1.0) < 1e-12);
}

}  // namespace
}  // namespace view_servo
