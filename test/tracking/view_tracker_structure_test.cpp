// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// How a ViewTracker learns the structure of the scene, and how it finds a pose by matches alone.
#include "view_tracker_test.h"

#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>

#include <cstddef>

namespace view_servo
{
namespace test
{
namespace
{
// ---- the structure

TEST_F(ViewTrackerTest, StartsWithDepthsFromTwoViews)
{
  ViewTracker tracker(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  EXPECT_FALSE(tracker.hasStructure());
  Rng rng(2);
  const PlanarPose there = desk().baseBefore(0.5, 0.2, 0.05);
  ASSERT_TRUE(tracker.start(desk().matches(there, 0.3, 0, rng), desk().truth(there)));
  EXPECT_TRUE(tracker.hasStructure());
  EXPECT_TRUE(tracker.depthsKnown());
  tracker.clear();
  EXPECT_FALSE(tracker.hasStructure());
}

TEST_F(ViewTrackerTest, StartRefusesTooFewAndChangesNothing)
{
  ViewTracker tracker(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  Rng rng(3);
  const PlanarPose there = desk().baseBefore(0.5, 0.2, 0.05);
  Correspondences few = desk().matches(there, 0.0, 0, rng);
  ASSERT_GT(few.size(), 40U);
  few.resize(static_cast<std::size_t>(ViewTrackerParams().min_supporting) - 1);
  EXPECT_FALSE(tracker.start(few, desk().truth(there)));
  EXPECT_FALSE(tracker.start({}, desk().truth(there)));
  EXPECT_FALSE(tracker.hasStructure());
  // Many, but all at the border, where there is no room for a patch.
  Correspondences border;
  for (int v = 10; v < 470; v += 10)
  {
    const Eigen::Vector2d point = desk().mount().level(desk().world().camera.normalized({ 3.0, v }));
    border.push_back({ point, 1.2 * point });
  }
  EXPECT_FALSE(tracker.start(border, { 0.5, 0.0, 0.0 }));
  EXPECT_FALSE(tracker.hasStructure());
  // A structure that is there stays.
  ViewTracker started = desk().tracker();
  EXPECT_FALSE(started.start(few, desk().truth(there)));
  const PlanarPose here = desk().nearIt();
  EXPECT_TRUE(started.track(desk().image(here), desk().truth(here)).found);
}

TEST_F(ViewTrackerTest, AssumesDepthsWhereNothingTellsThem)
{
  ViewTracker tracker(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  Rng rng(4);
  const PlanarPose there = desk().baseBefore(0.01, 0.0, 0.01);
  ASSERT_TRUE(tracker.start(desk().matches(there, 0.1, 0, rng), desk().truth(there)));
  EXPECT_TRUE(tracker.hasStructure());
  EXPECT_FALSE(tracker.depthsKnown());
  // Near the view that does.
  const auto result = tracker.track(desk().image(there), {});
  expectFound(result, desk().truth(there), 0.01, 0.2 * DEGREE);
}

TEST_F(ViewTrackerTest, KeepsNoMoreLandmarksThanAsked)
{
  ViewTrackerParams params;
  params.max_landmarks = 30;
  const ViewTracker tracker = desk().tracker(params);
  const PlanarPose here = desk().nearIt();
  const auto result = tracker.track(desk().image(here), desk().truth(here));
  EXPECT_LE(result.looked_for, 30);
  EXPECT_GE(result.looked_for, 15);
}

TEST_F(ViewTrackerTest, MoreMatchesExtendIt)
{
  Rng rng(5);
  const PlanarPose there = desk().baseBefore(0.5, 0.2, 0.05);
  const Correspondences all = desk().matches(there, 0.3, 0, rng);
  ViewTracker tracker(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  ASSERT_TRUE(tracker.start(Correspondences(all.begin(), all.begin() + 25), desk().truth(there)));
  const PlanarPose here = desk().nearIt();
  const int before = tracker.track(desk().image(here), desk().truth(here)).looked_for;
  tracker.extend(all, desk().truth(there));
  const int after = tracker.track(desk().image(here), desk().truth(here)).looked_for;
  EXPECT_GT(after, 2 * before);
  // The same again adds nothing.
  tracker.extend(all, desk().truth(there));
  EXPECT_EQ(tracker.track(desk().image(here), desk().truth(here)).looked_for, after);
}

// ---- by matches

TEST_F(ViewTrackerTest, LocatesWithoutPrediction)
{
  const ViewTracker tracker = desk().tracker();
  Rng rng(6);
  for (const PlanarPose& here : { desk().baseBefore(0.9, -0.5, -0.15), desk().baseBefore(0.3, 0.2, 0.1), desk().base(),
                                  desk().baseBefore(-0.4, 0.1, 0.0) })
  {
    const PlanarPose truth = desk().truth(here);
    const Correspondences matches = desk().matches(here, 0.7, 60, rng);
    const auto result = tracker.locate(matches);
    expectFound(result, truth, 0.02, 0.3 * DEGREE);
    EXPECT_GT(result.supporting, 40);
  }
}

TEST_F(ViewTrackerTest, LocatesNothingByMatchesOfNothing)
{
  const ViewTracker tracker = desk().tracker();
  EXPECT_FALSE(tracker.locate({}).found);
  Rng rng(7);
  for (int trial = 0; trial < 5; ++trial)
  {
    Correspondences random = desk().matches(desk().base(), 0.0, 150, rng);
    random.erase(random.begin(), random.end() - 150);
    EXPECT_FALSE(tracker.locate(random).found) << trial;
  }
  // Of points that are no landmarks.
  Correspondences elsewhere = desk().matches(desk().baseBefore(0.2, 0.0, 0.0), 0.0, 0, rng);
  for (Correspondence& match : elsewhere)
  {
    match.reference.x() += 0.5;
  }
  EXPECT_FALSE(tracker.locate(elsewhere).found);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
