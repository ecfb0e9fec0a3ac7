// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/heading_hypotheses.h"
#include "view_servo/parameters/numbers.h"

#include "support/level_matches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using test::FOCAL_LENGTH;
using test::inCurrentCamera;
using test::inImage;
using test::noisy;
using test::randomPosition;

/** Matches of points 1.5 to 6 m away from the reference camera. */
void addMatches(const PlanarPose& reference_in_current, int count, Rng& rng, Correspondences& matches)
{
  for (int added = 0; added < count;)
  {
    const Eigen::Vector2d reference = randomPosition(rng);
    const Eigen::Vector3d p = uniform(rng, 1.5, 6.0) * reference.homogeneous();
    const Eigen::Vector3d current = inCurrentCamera(p, reference_in_current);
    const Eigen::Vector2d position = current.hnormalized();
    if (current.z() > 0.2 && inImage(position))
    {
      matches.push_back({ noisy(reference, rng), noisy(position, rng) });
      ++added;
    }
  }
}

void addRandomMatches(int count, Rng& rng, Correspondences& matches)
{
  for (int i = 0; i < count; ++i)
  {
    const Eigen::Vector2d reference = randomPosition(rng);
    matches.push_back({ reference, randomPosition(rng) });
  }
}

/** A scene with a structure that repeats: some of the matches are of the copy beside it. */
struct RepeatedScene
{
  PlanarPose view{ 1.2, 0.3, 0.1 };    ///< the stored view's camera in odometry's frame
  Eigen::Vector2d copy{ 0.1, -0.55 };  ///< from the view to where the copy looks the same

  /** @param camera in odometry's frame. */
  Correspondences matches(const PlanarPose& camera, int good, int of_copy, int random, Rng& rng) const
  {
    Correspondences result;
    addMatches(compose(inverse(camera), view), good, rng, result);
    addMatches(compose(inverse(camera), { view.x + copy.x(), view.y + copy.y(), view.yaw }), of_copy, rng, result);
    addRandomMatches(random, rng, result);
    return result;
  }

  /** Whether a hypothesis is of the view (or of its copy), seen from a camera. */
  bool isOf(bool the_copy, const HeadingHypothesis& hypothesis, const PlanarPose& camera) const
  {
    const PlanarPose place{ view.x + (the_copy ? copy.x() : 0.0), view.y + (the_copy ? copy.y() : 0.0), view.yaw };
    const PlanarPose truth = compose(inverse(camera), place);
    return std::abs(wrapAngle(hypothesis.view_in_camera.heading() - truth.heading())) < 2.5 * DEGREE &&
           std::abs(wrapAngle(hypothesis.view_in_camera.yaw - truth.yaw)) < 1.0 * DEGREE;
  }
};

int countOf(const RepeatedScene& scene, bool the_copy, const HeadingHypotheses& hypotheses, const PlanarPose& camera)
{
  int count = 0;
  for (const HeadingHypothesis& hypothesis : hypotheses.list())
  {
    count += scene.isOf(the_copy, hypothesis, camera) ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST(HeadingHypotheses, FindTheMotion)
{
  const PlanarPose camera{ 2.0, -1.0, 0.6 };  // anywhere
  for (const double heading : { -0.9, 0.0, 0.5, M_PI - 0.2 })
  {
    for (const double yaw : { -0.2, 0.0, 0.3 })
    {
      Rng rng(1);
      HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
      EXPECT_TRUE(hypotheses.list().empty());
      Correspondences matches;
      addMatches({ 0.7 * std::cos(heading), 0.7 * std::sin(heading), yaw }, 60, rng, matches);
      addRandomMatches(60, rng, matches);
      hypotheses.update(matches, camera);
      ASSERT_EQ(hypotheses.list().size(), 1U) << heading << ", " << yaw;
      const HeadingHypothesis& found = hypotheses.list().front();
      EXPECT_LT(std::abs(wrapAngle(found.view_in_camera.heading() - heading)), 2.0 * DEGREE) << heading << ", " << yaw;
      EXPECT_NEAR(found.view_in_camera.yaw, yaw, 0.5 * DEGREE);
      EXPECT_NEAR(found.view_in_camera.distance(), 1.0, 1e-9);
      EXPECT_EQ(found.updates, 1);
      EXPECT_GE(found.support.size(), 55U);
      EXPECT_LE(found.support.size(), 70U);
      EXPECT_NEAR(found.weight, static_cast<double>(found.support.size()) / 120.0, 1e-12);
    }
  }
}

TEST(HeadingHypotheses, PlaceTheViewInOdometrysFrame)
{
  HeadingHypothesesParams params;
  params.assumed_distance = 0.8;
  HeadingHypotheses hypotheses(params, FOCAL_LENGTH);
  const PlanarPose camera{ 2.0, -1.0, 0.6 };
  Rng rng(2);
  Correspondences matches;
  addMatches({ 0.5, 0.2, 0.1 }, 80, rng, matches);
  hypotheses.update(matches, camera);
  ASSERT_EQ(hypotheses.list().size(), 1U);
  const PlanarPose& view = hypotheses.list().front().view_in_odom;
  const PlanarPose in_camera = compose(inverse(camera), view);
  EXPECT_NEAR(in_camera.distance(), 0.8, 1e-9);
  EXPECT_NEAR(in_camera.heading(), std::atan2(0.2, 0.5), 2.0 * DEGREE);
  EXPECT_NEAR(in_camera.yaw, 0.1, 0.5 * DEGREE);
}

TEST(HeadingHypotheses, FollowTheViewWhileTheCameraMoves)
{
  const RepeatedScene scene;
  HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
  Rng rng(3);
  for (int i = 0; i < 12; ++i)
  {
    // To the side, so that the heading changes by much; and turning.
    const PlanarPose camera{ 0.03 * i, 0.08 * i, 0.03 * i };
    hypotheses.update(scene.matches(camera, 60, 0, 60, rng), camera);
    ASSERT_EQ(hypotheses.list().size(), 1U) << i;
    EXPECT_TRUE(scene.isOf(false, hypotheses.list().front(), camera)) << i;
    EXPECT_EQ(hypotheses.list().front().updates, i + 1);
    EXPECT_LE(hypotheses.list().front().weight, 1.0 / 0.3);
  }
  // 50 to 60 % of the matches, again and again.
  EXPECT_NEAR(hypotheses.list().front().weight, 0.52 / 0.3, 0.2);
}

TEST(HeadingHypotheses, KeepBothWhenMatchesDisagree)
{
  const RepeatedScene scene;
  const PlanarPose camera{ 0.1, 0.1, 0.0 };
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
    Rng rng(seed);
    hypotheses.update(scene.matches(camera, 60, 40, 0, rng), camera);
    ASSERT_EQ(hypotheses.list().size(), 2U) << seed;
    EXPECT_TRUE(scene.isOf(false, hypotheses.list()[0], camera)) << seed;
    EXPECT_TRUE(scene.isOf(true, hypotheses.list()[1], camera)) << seed;
    EXPECT_GT(hypotheses.list()[0].weight, hypotheses.list()[1].weight);
  }
}

TEST(HeadingHypotheses, PreferTheOneThatIsConfirmedAgainAndAgain)
{
  const RepeatedScene scene;
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
    Rng rng(seed);
    PlanarPose camera;
    for (int i = 0; i < 4; ++i)
    {
      camera = { 0.05 * i, 0.01 * i, 0.0 };
      hypotheses.update(scene.matches(camera, 50, 0, 50, rng), camera);
    }
    // Once most matches are of the copy.
    hypotheses.update(scene.matches(camera, 30, 60, 10, rng), camera);
    ASSERT_GE(hypotheses.list().size(), 2U) << seed;
    EXPECT_TRUE(scene.isOf(false, hypotheses.list()[0], camera)) << seed;
    EXPECT_EQ(countOf(scene, true, hypotheses, camera), 1) << seed;
    // Alone, that set would have meant the copy.
    HeadingHypotheses without_memory(HeadingHypothesesParams(), FOCAL_LENGTH);
    without_memory.update(scene.matches(camera, 30, 60, 10, rng), camera);
    ASSERT_FALSE(without_memory.list().empty());
    EXPECT_TRUE(scene.isOf(true, without_memory.list()[0], camera)) << seed;
  }
}

TEST(HeadingHypotheses, ForgetWhatNothingConfirms)
{
  RepeatedScene scene;
  scene.copy = { 0.1, -2.5 };
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
    Rng rng(seed);
    hypotheses.update(scene.matches({}, 60, 40, 20, rng), {});
    ASSERT_EQ(countOf(scene, true, hypotheses, {}), 1) << seed;
    PlanarPose camera;
    for (int i = 1; i <= 15; ++i)
    {
      camera = { 0.02 * i, 0.05 * i, 0.0 };
      hypotheses.update(scene.matches(camera, 60, 0, 60, rng), camera);
      EXPECT_TRUE(scene.isOf(false, hypotheses.list().front(), camera)) << seed << ", " << i;
    }
    EXPECT_EQ(hypotheses.list().size(), 1U) << seed;
  }
}

TEST(HeadingHypotheses, WhatOnlyChanceConfirmsStaysFarBehind)
{
  // No match is of the copy any more: what agrees with it does so by chance, and agrees with the view as well.
  RepeatedScene scene;
  scene.copy = { 0.1, -2.5 };
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
    Rng rng(seed);
    hypotheses.update(scene.matches({}, 60, 40, 20, rng), {});
    ASSERT_EQ(hypotheses.list().size(), 2U) << seed;
    PlanarPose camera;
    for (int i = 1; i <= 10; ++i)
    {
      camera = { 0.02 * i, 0.05 * i, 0.0 };
      hypotheses.update(scene.matches(camera, 60, 0, 60, rng), camera);
    }
    EXPECT_TRUE(scene.isOf(false, hypotheses.list()[0], camera)) << seed;
    if (hypotheses.list().size() > 1U)
    {
      EXPECT_LT(hypotheses.list()[1].weight, 0.4 * hypotheses.list()[0].weight) << seed;
    }
  }
}

TEST(HeadingHypotheses, RandomMatchesConfirmNothing)
{
  const RepeatedScene scene;
  for (const int count : { 30, 120 })
  {
    for (std::uint64_t seed = 1; seed <= 3; ++seed)
    {
      HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
      Rng rng(seed);
      hypotheses.update(scene.matches({}, 60, 0, 0, rng), {});
      ASSERT_EQ(hypotheses.list().size(), 1U);
      const HeadingHypothesis at_first = hypotheses.list().front();
      for (int i = 0; i < 5; ++i)
      {
        Correspondences matches;
        addRandomMatches(count, rng, matches);
        hypotheses.update(matches, {});
      }
      if (!hypotheses.list().empty())
      {
        EXPECT_EQ(hypotheses.list().front().updates, 1) << count << " matches, seed " << seed;
        EXPECT_LT(hypotheses.list().front().weight, 0.2 * at_first.weight) << count << " matches, seed " << seed;
      }
    }
  }
}

TEST(HeadingHypotheses, NoneWithoutAnyReason)
{
  HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
  Rng rng(5);
  hypotheses.update({}, {});
  EXPECT_TRUE(hypotheses.list().empty());
  for (int i = 0; i < 15; ++i)
  {
    Correspondences matches;
    addRandomMatches(20 + 10 * i, rng, matches);
    hypotheses.update(matches, {});
    EXPECT_TRUE(hypotheses.list().empty()) << i;
  }
}

TEST(HeadingHypotheses, NoneOfPointsAlongOneEpipolarLine)
{
  // Matched at random along the line: each point agrees with each, whatever the motion along it.
  Rng rng(6);
  for (int trial = 0; trial < 10; ++trial)
  {
    HeadingHypotheses hypotheses(HeadingHypothesesParams(), FOCAL_LENGTH);
    Correspondences matches;
    for (int i = 0; i < 60; ++i)
    {
      const Eigen::Vector2d direction(0.8, 0.6);
      const double near = uniform(rng, 0.1, 0.5);
      matches.push_back({ noisy(near * direction, rng), noisy(uniform(rng, 0.1, 0.5) * direction, rng) });
    }
    hypotheses.update(matches, {});
    EXPECT_TRUE(hypotheses.list().empty()) << trial;
  }
}

TEST(HeadingHypotheses, KeepNoMoreThanAsked)
{
  HeadingHypothesesParams params;
  params.max_hypotheses = 1;
  const RepeatedScene scene;
  HeadingHypotheses hypotheses(params, FOCAL_LENGTH);
  Rng rng(8);
  hypotheses.update(scene.matches({}, 60, 40, 0, rng), {});
  ASSERT_EQ(hypotheses.list().size(), 1U);
  EXPECT_TRUE(scene.isOf(false, hypotheses.list().front(), {}));
  hypotheses.clear();
  EXPECT_TRUE(hypotheses.list().empty());
}

TEST(HeadingHypotheses, SameSeedGivesTheSameHypotheses)
{
  const auto run = [](std::uint64_t seed) {
    const RepeatedScene scene;
    HeadingHypothesesParams params;
    params.seed = seed;
    HeadingHypotheses hypotheses(params, FOCAL_LENGTH);
    Rng rng(9);
    for (int i = 0; i < 3; ++i)
    {
      const PlanarPose camera{ 0.05 * i, 0.0, 0.0 };
      hypotheses.update(scene.matches(camera, 50, 30, 40, rng), camera);
    }
    return hypotheses.list();
  };
  const std::vector<HeadingHypothesis> first = run(3);
  const std::vector<HeadingHypothesis> second = run(3);
  ASSERT_EQ(first.size(), second.size());
  ASSERT_GE(first.size(), 2U);
  for (std::size_t i = 0; i < first.size(); ++i)
  {
    EXPECT_EQ(first[i].view_in_odom.x, second[i].view_in_odom.x);
    EXPECT_EQ(first[i].view_in_odom.y, second[i].view_in_odom.y);
    EXPECT_EQ(first[i].view_in_odom.yaw, second[i].view_in_odom.yaw);
    EXPECT_EQ(first[i].weight, second[i].weight);
    EXPECT_EQ(first[i].support.size(), second[i].support.size());
  }
}

TEST(HeadingHypothesesParams, NameAllFaultsAtOnce)
{
  EXPECT_TRUE(HeadingHypothesesParams().validate().empty());
  HeadingHypothesesParams params;
  params.inlier_threshold = 0.0;
  params.max_yaw = M_PI_2;
  params.min_significance = std::numeric_limits<double>::quiet_NaN();
  params.memory = 1.0;
  params.max_hypotheses = 0;
  params.assumed_distance = 0.0;
  const std::vector<std::string> faults = params.validate();
  ASSERT_EQ(faults.size(), 6U);
  const std::vector<std::string> names{ "inlier_threshold", "max_yaw",        "min_significance",
                                        "memory",           "max_hypotheses", "assumed_distance" };
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    EXPECT_EQ(faults[i].find(names[i]), 0U) << faults[i];
  }
}

}  // namespace view_servo
