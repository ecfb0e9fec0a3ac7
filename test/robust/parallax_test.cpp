// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/parallax.h"

#include "support/synthetic_scene.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/significance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace view_servo
{
namespace
{
constexpr double PARALLAX_THRESHOLD = 2.0;  // [px]

/** Pairs on the plane of a scene, pairs off it, and wrong ones. */
struct PlaneScene
{
  test::Scene scene;
  Correspondences pairs;

  PlaneScene(int off_plane, int wrong, std::uint64_t seed)
  {
    Rng rng(seed);
    test::SceneOptions options;
    options.inliers = 300;
    options.noise = 0.3;
    options.planar = true;
    options.shuffle = false;
    scene = test::makeScene(options, rng);
    pairs = scene.pairs;
    for (int i = 0; i < off_plane + wrong; ++i)
    {
      const Eigen::Vector2d reference = test::randomPixel(rng);
      const Eigen::Vector3d x = uniform(rng, 2.5, 7.0) * (scene.k.inverse() * reference.homogeneous());
      const Eigen::Vector2d seen = (scene.k * (scene.r * x + scene.t)).hnormalized();
      pairs.push_back({ reference, i < off_plane ? seen : test::randomPixel(rng) });
    }
  }
};

double meanError(const Eigen::Matrix3d& f, const Correspondences& pairs, std::size_t begin, std::size_t end)
{
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i)
  {
    sum += std::sqrt(sampsonError(f, pairs[i]));
  }
  return sum / static_cast<double>(end - begin);
}

}  // namespace

TEST(Parallax, FindsTheEpipoleThatAPlaneLeavesOpen)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    const PlaneScene plane(25, 50, seed);
    const Parallax parallax(plane.scene.homography, plane.pairs, PARALLAX_THRESHOLD);
    Rng rng(seed);
    const auto f = parallax.findFundamental(1500, rng);
    ASSERT_TRUE(f);
    EXPECT_GT(parallax.significance(*f), 5.0) << seed;
    EXPECT_LT(meanError(*f, plane.pairs, 0, 300), 1.5) << seed;
    EXPECT_LT(meanError(*f, plane.pairs, 300, 325), 3.0) << seed;
    EXPECT_GT(parallax.significance(plane.scene.fundamental), 5.0) << seed;
  }
}

TEST(Parallax, IsNotSignificantByChance)
{
  // Nothing but the plane and wrong pairs: the best of all epipoles is one of chance.
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    const PlaneScene plane(0, 150, seed);
    const Parallax parallax(plane.scene.homography, plane.pairs, PARALLAX_THRESHOLD);
    Rng rng(seed);
    const auto f = parallax.findFundamental(1500, rng);
    ASSERT_TRUE(f);
    EXPECT_LT(parallax.significance(*f), 1.0) << seed;
  }
}

TEST(Parallax, TellsOffWhateverPlaneIsTheBest)
{
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    Rng rng(seed);
    const PlaneScene deep(40, 50, seed);
    EXPECT_GT(significanceOffBestPlane(deep.scene.fundamental, deep.pairs, PARALLAX_THRESHOLD, rng), 5.0) << seed;
    // Any epipole agrees with what is on the plane.
    const PlaneScene flat(0, 150, seed);
    EXPECT_LT(significanceOffBestPlane(flat.scene.fundamental, flat.pairs, PARALLAX_THRESHOLD, rng), 1.0) << seed;
  }
}

TEST(Parallax, IsSeenWhereItIsSmallAndMatchesAreExact)
{
  // The second plane is a fiftieth farther: its parallax is below twice the threshold.
  Rng rng(2);
  test::SceneOptions options;
  options.inliers = 300;
  options.noise = 0.05;
  options.planar = true;
  options.shuffle = false;
  const test::Scene scene = test::makeScene(options, rng);
  Correspondences pairs = scene.pairs;
  const Eigen::Vector3d epipole = currentEpipole(scene.fundamental);
  for (int i = 0; i < 100; ++i)
  {
    Correspondence& pair = pairs[static_cast<std::size_t>(3 * i)];
    const Eigen::Vector2d towards = (epipole.hnormalized() - pair.current).normalized();
    pair.current += uniform(rng, 1.0, 2.5) * towards;
  }
  EXPECT_LT(Parallax(scene.homography, pairs, PARALLAX_THRESHOLD).significance(scene.fundamental), 0.0);
  EXPECT_GT(significanceOffBestPlane(scene.fundamental, pairs, PARALLAX_THRESHOLD, rng), 5.0);
}

TEST(Parallax, OfAPlaneAloneIsNone)
{
  const PlaneScene plane(0, 0, 3);
  const Parallax parallax(plane.scene.homography, plane.pairs, PARALLAX_THRESHOLD);
  Rng rng(1);
  EXPECT_FALSE(parallax.findFundamental(100, rng));
  EXPECT_LT(parallax.significance(plane.scene.fundamental), 0.0);
}

TEST(BinomialTail, BoundsTheTrueProbability)
{
  // P(5 or more of 10 at 0.1) = 0.0016349, of 10 of 10 = 1e-10.
  EXPECT_GE(logBinomialTail(10, 5, 0.1), std::log10(0.0016349));
  EXPECT_LT(logBinomialTail(10, 5, 0.1), -2.0);
  EXPECT_NEAR(logBinomialTail(10, 10, 0.1), -10.0, 1e-9);
  EXPECT_EQ(logBinomialTail(10, 1, 0.1), 0.0);
  EXPECT_EQ(logBinomialTail(0, 0, 0.1), 0.0);
}

TEST(Orientation, IsKeptByAViewAndLostInAMirror)
{
  Rng rng(4);
  test::SceneOptions options;
  options.planar = true;
  test::Scene scene = test::makeScene(options, rng);
  EXPECT_TRUE(keepsOrientation(scene.pairs));
  for (Correspondence& pair : scene.pairs)
  {
    pair.current.x() = test::IMAGE_WIDTH - pair.current.x();
  }
  EXPECT_FALSE(keepsOrientation(scene.pairs));
}

TEST(Orientation, IsKeptInMostPlacesByViewsOfASceneButNotAlongEpipolarLinesAtRandom)
{
  constexpr double PART = 0.75;
  constexpr double PERIOD = 48.0;  // of a row of windows [px]
  Rng rng(4);
  Correspondences windows;
  Correspondences scattered;
  for (double v = 40.0; v < 440.0; v += PERIOD)
  {
    for (double u = 40.0; u < 600.0; u += PERIOD)
    {
      windows.push_back({ { u, v }, { u + 0.1 * v, v } });
      // Of each window another one in its row: the epipolar line is the same.
      scattered.push_back({ { u, v }, { 40.0 + PERIOD * static_cast<double>(uniformIndex(rng, 12)) + 0.1 * v, v } });
    }
  }
  EXPECT_TRUE(keepsOrientation(windows, PART));
  EXPECT_FALSE(keepsOrientation(scattered, PART));
}

TEST(Orientation, IsNotToldByTheSamePointMatchedAgain)
{
  // Ten matches of each of forty points, not quite the same: among themselves they turn either way.
  Rng rng(5);
  Correspondences pairs;
  for (int i = 0; i < 400; ++i)
  {
    const Eigen::Vector2d at(60.0 * (i % 8), 60.0 * (i % 5));
    const Eigen::Vector2d jitter(uniform(rng, -0.5, 0.5), uniform(rng, -0.5, 0.5));
    pairs.push_back({ at + jitter, { at.x() + 20.0 + uniform(rng, -0.5, 0.5), at.y() + uniform(rng, -0.5, 0.5) } });
  }
  EXPECT_TRUE(keepsOrientation(pairs, 0.95));
}

}  // namespace view_servo
