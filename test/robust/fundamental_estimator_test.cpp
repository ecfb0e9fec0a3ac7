// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/fundamental_estimator.h"

#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>

namespace view_servo
{
namespace
{
constexpr double HUBER_WIDTH = 0.5;  // [px]

/** What a camera that moves sideways sees of two planes, the nearer one above. Noise in px. */
Correspondences twoPlanes(int count, double noise, Rng& rng)
{
  Correspondences pairs;
  for (int i = 0; i < count; ++i)
  {
    const Eigen::Vector2d at(uniform(rng, 0.0, 480.0), uniform(rng, 0.0, 360.0));
    const Eigen::Vector2d shift(at.y() < 180.0 ? 40.0 : 12.0, 0.0);
    pairs.push_back({ at, at + shift + noise * Eigen::Vector2d(gaussian(rng), gaussian(rng)) });
  }
  return pairs;
}

/** Of the epipolar line of a point near the border; that of a camera that moves sideways is 0. */
double slopeOf(const Eigen::Matrix3d& f)
{
  const Eigen::Vector3d line = f * Eigen::Vector3d(200.0, 20.0, 1.0);
  return std::abs(line.x() / line.y());
}

/** Fits what moves sideways in front of two planes to within some pixels, and is far from it. */
Eigen::Matrix3d tilted()
{
  Eigen::Matrix3d f;
  f << 0.0, -0.00116, 0.21, 0.00116, -8.7e-5, 1.0, -0.21, -0.94, -8.8;
  return f;
}

TEST(PolishFundamental, AWrongPairDoesNotTiltWhatTwoPlanesHoldWeakly)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    Rng rng(seed);
    Correspondences pairs = twoPlanes(300, 0.02, rng);
    const Eigen::Vector2d at(150.0, 20.0);
    const Eigen::Vector3d line = tilted() * at.homogeneous();
    const double x = at.x() + 300.0;
    pairs.push_back({ at, { x, -(line.x() * x + line.z()) / line.y() } });  // it fits the tilted one alone
    const Eigen::Matrix3d plain = refineFundamental(tilted(), pairs, HUBER_WIDTH);
    EXPECT_GT(slopeOf(plain), 0.02) << "the wrong pair does not tilt it";
    EXPECT_LT(slopeOf(polishFundamental(tilted(), pairs, HUBER_WIDTH)), 0.005);
  }
}

TEST(PolishFundamental, IsAsExactAsAFitToAllWhenAllAreRight)
{
  double plain = 0.0;
  double polished = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    Rng rng(seed);
    const Correspondences pairs = twoPlanes(200, 0.5, rng);
    const auto linear = fundamentalFromPoints(pairs);
    ASSERT_TRUE(linear);
    plain += slopeOf(refineFundamental(*linear, pairs, HUBER_WIDTH));
    polished += slopeOf(polishFundamental(*linear, pairs, HUBER_WIDTH));
  }
  EXPECT_LT(polished, 1.2 * plain);
}

TEST(PolishFundamental, FewPairsAreOnlyRefined)
{
  Rng rng(3);
  const Correspondences pairs = twoPlanes(12, 0.1, rng);
  EXPECT_EQ(polishFundamental(tilted(), pairs, HUBER_WIDTH), refineFundamental(tilted(), pairs, HUBER_WIDTH));
  EXPECT_EQ(polishFundamental(tilted(), {}, HUBER_WIDTH), tilted());
}

}  // namespace
}  // namespace view_servo
