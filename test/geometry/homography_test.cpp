// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/numbers.h"

#include "../../src/geometry/levenberg_marquardt.h"
#include "../../src/geometry/residuals.h"
#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
double totalTransferError(const Eigen::Matrix3d& h, const Correspondences& pairs)
{
  const Eigen::Matrix3d h_inverse = h.inverse();
  double sum = 0.0;
  for (const Correspondence& pair : pairs)
  {
    sum += symmetricTransferError(h, h_inverse, pair);
  }
  return sum;
}

/** RMS distance over the image between where two homographies send a point [px]. */
double rmsDistance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  double sum = 0.0;
  int count = 0;
  for (double u = 0.0; u < test::IMAGE_WIDTH; u += 40.0)
  {
    for (double v = 0.0; v < test::IMAGE_HEIGHT; v += 40.0)
    {
      sum += (transfer(a, { u, v }) - transfer(b, { u, v })).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

test::Scene planarScene(int points, double noise, std::uint64_t seed)
{
  return test::makeScene(points, noise, seed, true);
}

/** A well-spread sample: the corners of a rectangle, moved. */
Correspondences goodSample()
{
  return { { { 100, 100 }, { 120, 90 } },
           { { 500, 100 }, { 480, 130 } },
           { { 500, 400 }, { 490, 390 } },
           { { 100, 400 }, { 130, 420 } } };
}

TEST(NormalizedHomography, LastEntryIsOneUnlessItVanishesAndTheSignStays)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Random();
  h(2, 2) = 4.0;
  EXPECT_DOUBLE_EQ(normalizedHomography(h)(2, 2), 1.0);
  h(2, 2) = -4.0;
  EXPECT_DOUBLE_EQ(normalizedHomography(h)(2, 2), -1.0) << "points in view would be taken for behind the camera";
  EXPECT_LT(test::projectiveDistance(normalizedHomography(h), h), 1e-15);
  h(2, 2) = 0.0;
  EXPECT_NEAR(normalizedHomography(h).norm(), 1.0, 1e-15);
}

TEST(Transfer, BeyondInfinityIsNaN)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(2, 0) = -0.01;  // u = 100 is the line sent to infinity
  EXPECT_TRUE(transfer(h, { 50.0, 20.0 }).isApprox(Eigen::Vector2d(100.0, 40.0)));
  EXPECT_TRUE(transfer(h, { 100.0, 20.0 }).array().isNaN().all());
  EXPECT_TRUE(transfer(h, { 150.0, 20.0 }).array().isNaN().all());
}

TEST(SymmetricTransferError, SumsBothDirections)
{
  const Eigen::Matrix3d h = Eigen::Vector3d(2.0, 2.0, 1.0).asDiagonal();
  // 2 px off in the current image are 1 px off in the reference.
  EXPECT_DOUBLE_EQ(symmetricTransferError(h, h.inverse(), { { 10, 20 }, { 22, 40 } }), 4.0 + 1.0);
}

TEST(SymmetricTransferError, InfiniteBeyondInfinityAndForInvalidPoints)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(2, 0) = -0.01;
  const Eigen::Matrix3d h_inverse = h.inverse();
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(symmetricTransferError(h, h_inverse, { { 150, 0 }, { 0, 0 } }), infinite);
  EXPECT_EQ(symmetricTransferError(h, h_inverse, { { 0, 0 }, { -150, 0 } }), infinite);  // only on the way back
  EXPECT_EQ(symmetricTransferError(h, h_inverse, { { NOT_A_NUMBER, 0 }, { 0, 0 } }), infinite);
  EXPECT_EQ(symmetricTransferError(h, h_inverse, { { 0, 0 }, { 0, NOT_A_NUMBER } }), infinite);
}

TEST(HomographySample, AcceptsFourSpreadPoints)
{
  EXPECT_TRUE(isHomographySample(goodSample()));
}

TEST(HomographySample, RefusesOtherSizes)
{
  Correspondences pairs = goodSample();
  pairs.push_back({ { 300, 200 }, { 310, 210 } });
  EXPECT_FALSE(isHomographySample(pairs));
  pairs.resize(3);
  EXPECT_FALSE(isHomographySample(pairs));
}

TEST(HomographySample, RefusesThreeNearlyCollinearPointsInEitherImage)
{
  // Each corner in turn moves towards the middle of its neighbours' diagonal, staying on its own side of it.
  for (const auto side : { &Correspondence::reference, &Correspondence::current })
  {
    for (int moved = 0; moved < 4; ++moved)
    {
      Correspondences pairs = goodSample();
      const Eigen::Vector2d a = pairs[(moved + 1) % 4].*side;
      const Eigen::Vector2d b = pairs[(moved + 3) % 4].*side;
      const Eigen::Vector2d normal = Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
      const double outward = std::copysign(1.0, normal.dot(pairs[moved].*side - a));
      pairs[moved].*side = 0.5 * (a + b) + 1.9 * outward * normal;
      EXPECT_FALSE(isHomographySample(pairs)) << moved;
      EXPECT_TRUE(isHomographySample(pairs, 1.8)) << moved;
    }
  }
}

TEST(HomographySample, MinimumHeightIsInPixels)
{
  // A flat triangle of height 3 px below a far fourth point; the same in both images.
  Correspondences pairs;
  for (const Eigen::Vector2d& p : { Eigen::Vector2d(0, 0), { 100, 3 }, { 200, 0 }, { 100, -200 } })
  {
    pairs.push_back({ p, p });
  }
  EXPECT_TRUE(isHomographySample(pairs, 2.9));
  EXPECT_FALSE(isHomographySample(pairs, 3.1));
}

TEST(HomographySample, RefusesMirroredAndTwistedSamples)
{
  Correspondences mirrored = goodSample();
  for (Correspondence& pair : mirrored)
  {
    pair.current.x() = 640.0 - pair.current.x();
  }
  EXPECT_FALSE(isHomographySample(mirrored));

  Correspondences twisted = goodSample();
  std::swap(twisted[0].current, twisted[1].current);
  EXPECT_FALSE(isHomographySample(twisted));
}

TEST(HomographySample, RefusesCoincidentAndInvalidPoints)
{
  Correspondences coincident = goodSample();
  coincident[2] = coincident[0];
  EXPECT_FALSE(isHomographySample(coincident));
  EXPECT_FALSE(isHomographySample(Correspondences(4, goodSample()[0])));
  Correspondences invalid = goodSample();
  invalid[3].current.y() = NOT_A_NUMBER;
  EXPECT_FALSE(isHomographySample(invalid));
}

RC_GTEST_PROP(HomographyFromPoints, ExactDataGiveTheTruth, (std::uint64_t seed))
{
  const int points = *rc::gen::inRange(5, 60);
  const test::Scene scene = planarScene(points, 0.0, seed);
  const auto h = homographyFromPoints(scene.pairs);
  RC_ASSERT(h.has_value());
  RC_ASSERT(std::abs(h->norm() - 1.0) < 1e-12);
  RC_ASSERT(totalTransferError(*h, scene.pairs) < 1e-14);
  // The truth's sign gives points in view a positive third coordinate: no comparison up to sign.
  RC_ASSERT(points < 12 || (*h - scene.homography).norm() < 1e-8);
}

TEST(HomographyFromPoints, FourPointsAreMetExactly)
{
  const auto h = homographyFromPoints(goodSample());
  ASSERT_TRUE(h);
  EXPECT_LT(totalTransferError(*h, goodSample()), 1e-18);
}

TEST(HomographyFromPoints, SignIsPositiveForPointsInView)
{
  for (std::uint64_t seed = 0; seed < 20; ++seed)
  {
    const test::Scene scene = planarScene(20, 1.0, seed);
    const auto h = homographyFromPoints(scene.pairs);
    ASSERT_TRUE(h);
    for (const Correspondence& pair : scene.pairs)
    {
      EXPECT_GT((*h * pair.reference.homogeneous()).z(), 0.0);
    }
  }
}

TEST(HomographyFromPoints, EmptyForTooFewOrDegeneratePoints)
{
  Correspondences three = goodSample();
  three.pop_back();
  EXPECT_FALSE(homographyFromPoints(three));
  EXPECT_FALSE(homographyFromPoints({}));
  EXPECT_FALSE(homographyFromPoints(Correspondences(10, goodSample()[0])));

  Correspondences three_collinear = goodSample();
  three_collinear[2] = { 0.5 * (three_collinear[0].reference + three_collinear[1].reference),
                         0.5 * (three_collinear[0].current + three_collinear[1].current) };
  EXPECT_FALSE(homographyFromPoints(three_collinear));

  Correspondences collinear;
  for (int i = 0; i < 20; ++i)
  {
    collinear.push_back({ { 10.0 + 20.0 * i, 30.0 + 7.0 * i }, { 50.0 + 11.0 * i, 400.0 - 9.0 * i } });
  }
  EXPECT_FALSE(homographyFromPoints(collinear));

  Correspondences invalid = goodSample();
  invalid[1].reference.x() = NOT_A_NUMBER;
  EXPECT_FALSE(homographyFromPoints(invalid));
}

TEST(HomographyFromPoints, EmptyWhenAPointMapsBeyondInfinity)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(2, 0) = -0.01;
  Correspondences pairs;
  Rng rng(4);
  for (int i = 0; i < 12; ++i)
  {
    const double u = i < 6 ? uniform(rng, 0.0, 80.0) : uniform(rng, 120.0, 300.0);
    const Eigen::Vector2d reference(u, uniform(rng, 0.0, 300.0));
    pairs.push_back({ reference, (h * reference.homogeneous()).hnormalized() });
  }
  EXPECT_FALSE(homographyFromPoints(pairs));
  pairs.resize(6);  // those on one side of the line are fine
  ASSERT_TRUE(homographyFromPoints(pairs));
  EXPECT_LT(test::projectiveDistance(*homographyFromPoints(pairs), h), 1e-8);
}

RC_GTEST_PROP(TransferResidual, JacobiansMatchNumericOnes, (std::uint64_t seed))
{
  constexpr double STEP = 1e-6;
  const test::Scene scene = planarScene(1, 5.0, seed);
  // Near unit size, as in the refinement.
  const Normalization unit{ { 320.0, 240.0 }, 0.005 };
  const Correspondence pair = { unit(scene.pairs[0].reference), unit(scene.pairs[0].current) };
  const Eigen::Matrix3d h = (unit.matrix() * scene.homography * unit.inverseMatrix()).normalized();
  const Eigen::Matrix<double, 2, 9> forward = forwardResidual(h, pair).jacobian();
  const Eigen::Matrix<double, 2, 9> backward = backwardResidual(h.inverse(), pair).jacobian();
  for (int k = 0; k < 9; ++k)
  {
    Eigen::Matrix3d plus = h;
    Eigen::Matrix3d minus = h;
    plus(k / 3, k % 3) += STEP;
    minus(k / 3, k % 3) -= STEP;
    const Eigen::Vector2d numeric_forward =
        (forwardResidual(plus, pair).residual - forwardResidual(minus, pair).residual) / (2.0 * STEP);
    const Eigen::Vector2d numeric_backward =
        (backwardResidual(plus.inverse(), pair).residual - backwardResidual(minus.inverse(), pair).residual) /
        (2.0 * STEP);
    RC_ASSERT((forward.col(k) - numeric_forward).norm() < 1e-6 * (1.0 + numeric_forward.norm()));
    RC_ASSERT((backward.col(k) - numeric_backward).norm() < 1e-6 * (1.0 + numeric_backward.norm()));
  }
}

/** One residual, atan(x): Gauss-Newton steps from |x| > 1.4 overshoot ever further. */
struct ArcTangentProblem
{
  using State = double;
  static constexpr int DOF = 1;

  double cost(double x) const
  {
    return x > 10.0 ? NOT_A_NUMBER : std::atan(x) * std::atan(x);
  }
  void linearize(double x, Eigen::Matrix<double, 1, 1>& jtj, Eigen::Matrix<double, 1, 1>& gradient) const
  {
    const double derivative = 1.0 / (1.0 + x * x);
    jtj(0) = derivative * derivative;
    gradient(0) = derivative * std::atan(x);
  }
  double moved(double x, const Eigen::Matrix<double, 1, 1>& step) const
  {
    return x + step(0);
  }
};

TEST(LevenbergMarquardt, DescendsWhereGaussNewtonDiverges)
{
  double previous = ArcTangentProblem().cost(-3.0);
  for (int iterations = 1; iterations <= 5; ++iterations)
  {
    double x = -3.0;
    EXPECT_TRUE(levenbergMarquardt(ArcTangentProblem(), x, iterations));
    EXPECT_LT(ArcTangentProblem().cost(x), previous) << iterations;
    previous = ArcTangentProblem().cost(x);
  }
  EXPECT_LT(previous, 1e-6);
}

TEST(LevenbergMarquardt, LeavesAMinimumAndAForbiddenStateAlone)
{
  double x = 0.0;
  EXPECT_FALSE(levenbergMarquardt(ArcTangentProblem(), x, 10));
  EXPECT_EQ(x, 0.0);
  x = 11.0;
  EXPECT_FALSE(levenbergMarquardt(ArcTangentProblem(), x, 10));
  EXPECT_EQ(x, 11.0);
}

TEST(RefineHomography, LowersTheErrorAndGetsNearTheTruth)
{
  for (std::uint64_t seed = 0; seed < 20; ++seed)
  {
    const test::Scene scene = planarScene(100, 1.0, seed);
    const auto linear = homographyFromPoints(scene.pairs);
    ASSERT_TRUE(linear);
    const Eigen::Matrix3d refined = refineHomography(*linear, scene.pairs);
    const double error = totalTransferError(refined, scene.pairs);
    EXPECT_LT(error, totalTransferError(*linear, scene.pairs));
    EXPECT_LT(error, totalTransferError(scene.homography, scene.pairs));
    EXPECT_LT(rmsDistance(refined, scene.homography), 1.0);
    EXPECT_NEAR(refined.norm(), 1.0, 1e-12);
  }
}

TEST(RefineHomography, ReachesTheSameMinimumFromAPoorStart)
{
  for (std::uint64_t seed = 0; seed < 10; ++seed)
  {
    const test::Scene scene = planarScene(60, 0.5, seed);
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    shift(0, 2) = 15.0;
    shift(1, 0) = 0.03;
    const Eigen::Matrix3d good = refineHomography(*homographyFromPoints(scene.pairs), scene.pairs);
    const Eigen::Matrix3d poor = refineHomography(shift * scene.homography, scene.pairs);
    EXPECT_NEAR(totalTransferError(poor, scene.pairs), totalTransferError(good, scene.pairs), 1e-6);
    EXPECT_LT(rmsDistance(good, poor), 1e-3);
  }
}

TEST(RefineHomography, HuberWidthResistsOutliers)
{
  Rng rng(7);
  test::SceneOptions options;
  options.planar = true;
  options.noise = 0.5;
  test::Scene scene = test::makeScene(options, rng);
  for (int i = 0; i < 10; ++i)
  {
    scene.pairs[i].current += Eigen::Vector2d(40.0, 25.0);
  }
  const Eigen::Matrix3d plain = refineHomography(scene.homography, scene.pairs);
  const Eigen::Matrix3d robust = refineHomography(scene.homography, scene.pairs, 1.5);
  EXPECT_LT(rmsDistance(robust, scene.homography), 1.5);
  EXPECT_GT(rmsDistance(plain, scene.homography), 4.0);
}

TEST(RefineHomography, PairsBeyondInfinityAreLeftOut)
{
  const test::Scene scene = planarScene(50, 0.5, 11);
  const Eigen::Matrix3d linear = *homographyFromPoints(scene.pairs);
  const Eigen::Matrix3d expected = refineHomography(linear, scene.pairs);
  // A point sent beyond infinity: on the far side of the line given by the last row of H.
  const Eigen::Vector3d line = linear.row(2);
  const Eigen::Vector2d beyond = -2.0 * line.z() / line.head<2>().squaredNorm() * line.head<2>();
  ASSERT_TRUE(transfer(linear, beyond).array().isNaN().all());
  Correspondences pairs = scene.pairs;
  pairs.push_back({ beyond, { 10, 10 } });
  pairs.push_back({ { NOT_A_NUMBER, 0 }, { 10, 10 } });
  EXPECT_EQ(refineHomography(linear, pairs), expected);
}

TEST(RefineHomography, ReturnsTheInitialWhenItCannotBeImproved)
{
  const test::Scene scene = planarScene(20, 0.5, 3);
  const Eigen::Matrix3d initial = 2.0 * scene.homography;  // of another norm: it must come back as it is
  EXPECT_EQ(refineHomography(initial, {}), initial);
  EXPECT_EQ(refineHomography(initial, { scene.pairs.begin(), scene.pairs.begin() + 3 }), initial);
  EXPECT_EQ(refineHomography(initial, Correspondences(10, scene.pairs[0])), initial);
  EXPECT_EQ(refineHomography(initial, scene.pairs, 1.0, 0), initial);
  EXPECT_EQ(refineHomography(-initial, scene.pairs), -initial);  // all points beyond infinity
}

}  // namespace
}  // namespace view_servo
