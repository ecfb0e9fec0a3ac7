// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/scene_tracker.h"
#include "sim/renderer.h"
#include "sim/visibility.h"
#include "sim/world_reader.h"

#include "support/camera_pose_error.h"
#include "support/shipped_files.h"
#include "view_servo/geometry/region.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/tracking/scene_finder.h"
#include "view_servo/tracking/target_tracker.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using sim::World;

/** A world's view, and what a camera sees that goes to it. */
class ViewedWorld
{
public:
  explicit ViewedWorld(const std::string& name, std::uint64_t seed = 1)
    : world(sim::readWorld(test::worldFile(name))), camera_(world, {}, seed), reference(camera_.capture(world.goal))
  {
  }

  cv::Mat image(const Eigen::Isometry3d& camera, const sim::Light& light = {})
  {
    camera_.setLight(light);
    return camera_.capture(camera);
  }

  /** X_cur = motion X_view. */
  Eigen::Isometry3d motion(const Eigen::Isometry3d& camera) const
  {
    return camera.inverse() * world.goal;
  }

  /** A part of the way from a start to the goal, at which all of it is at the goal. */
  Eigen::Isometry3d onTheWay(const std::string& start, double part) const
  {
    const Eigen::Isometry3d& from = world.start(start);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = (1.0 - part) * from.translation() + part * world.goal.translation();
    pose.linear() =
        Eigen::Quaterniond(from.linear()).slerp(part, Eigen::Quaterniond(world.goal.linear())).toRotationMatrix();
    return pose;
  }

  /**
   * How far a depth [m] of a point of the view [px] is from what is there, as a logarithm. A corner on an outline may be
   * of what is in front or behind: that counts which is nearer to the depth.
   */
  double depthError(const Eigen::Vector2d& point, double depth) const
  {
    constexpr double REACH = 4.0;  // of what is seen at a corner [px]
    double least = std::numeric_limits<double>::infinity();
    for (const double right : { -REACH, 0.0, REACH })
    {
      for (const double down : { -REACH, 0.0, REACH })
      {
        const Eigen::Vector3d ray = world.camera.normalized(point + Eigen::Vector2d(right, down)).homogeneous();
        const auto distance = sim::firstHit(world, world.goal.translation(), world.goal.linear() * ray.normalized());
        if (distance)
        {
          least = std::min(least, std::abs(std::log(depth * ray.norm() / *distance)));
        }
      }
    }
    return least;
  }

  /** The answer that the finder gives. */
  SceneFinder::Answer find(const cv::Mat& image) const
  {
    const SceneFinder finder;
    const auto view = std::make_shared<const PreparedImage>(reference, world.region, finder.features());
    return finder.find({ view, world.camera, image, world.camera });
  }

  SceneTracker tracker(const PlaneTrackerParams& params = PlaneTrackerParams()) const
  {
    return SceneTracker(reference, world.region, world.camera.k, params);
  }

  World world;

private:
  sim::SimulatedCamera camera_;

public:
  cv::Mat reference;
};

double turnFrom(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  return Eigen::AngleAxisd(a.transpose() * b).angle();
}

constexpr int STEPS_TO_GOAL = 20;  // from a start to the goal

class SceneTrackerTest : public testing::TestWithParam<const char*>
{
};

}  // namespace

TEST_P(SceneTrackerTest, KnowsThePoseAllTheWay)
{
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  const SceneFinder::Answer answer = scene.find(scene.image(scene.onTheWay("far", 0.0)));
  ASSERT_EQ(answer.kind, SceneFinder::Kind::SCENE) << answer.reason;
  tracker.start(answer, scene.onTheWay("far", 0.0));
  for (int i = 0; i <= STEPS_TO_GOAL; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("far", static_cast<double>(i) / STEPS_TO_GOAL);
    const PlaneTrack& track = tracker.add(scene.image(camera, { 0.8, 10.0, 0.3 }), camera);
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    ASSERT_TRUE(track.plane);
    const EuclideanHomography& motion = track.plane->motion;
    const Eigen::Isometry3d truth = scene.motion(camera);
    EXPECT_LT(turnFrom(motion.rotation, truth.linear()), (i == 0 ? 0.2 : 0.1) * DEGREE) << i;  // first as found
    EXPECT_EQ(motion.normal, Eigen::Vector3d::UnitZ());
    if (const double way = (camera.translation() - scene.world.start("far").translation()).norm();
        way < 0.02 || way > 0.08)
    {
      EXPECT_EQ(track.plane->distance.has_value(), way > 0.05) << i << ": known once the camera has moved enough";
    }
    if (track.plane->distance)
    {
      const Eigen::Vector3d way = *track.plane->distance * motion.translation_over_distance;
      EXPECT_LT((way - truth.translation()).norm(), 1e-4 + 0.01 * truth.translation().norm()) << i;
    }
  }
  const EuclideanHomography& there = tracker.track().plane->motion;
  EXPECT_LT(there.translation_over_distance.norm(), 2e-4);
  EXPECT_LT(turnFrom(there.rotation, Eigen::Matrix3d::Identity()), 0.01 * DEGREE);
  EXPECT_TRUE((tracker.track().homography.h - Eigen::Matrix3d::Identity()).norm() < 0.2);
}

TEST_P(SceneTrackerTest, KnowsHowExactThePoseIs)
{
  constexpr int RUNS = 4;
  double normalised = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= RUNS; ++seed)
  {
    ViewedWorld scene(GetParam(), seed);
    SceneTracker tracker = scene.tracker();
    tracker.start(scene.find(scene.image(scene.onTheWay("far", 0.0))), scene.onTheWay("far", 0.0));
    EXPECT_FALSE(tracker.cameraPose());
    for (int i = 0; i <= STEPS_TO_GOAL; ++i)
    {
      const Eigen::Isometry3d camera = scene.onTheWay("far", static_cast<double>(i) / STEPS_TO_GOAL);
      tracker.add(scene.image(camera), camera);
      if (const auto pose = tracker.cameraPose())
      {
        normalised += test::normalisedError(*pose, scene.motion(camera).inverse());
        ++count;
      }
    }
  }
  EXPECT_GT(count, RUNS * STEPS_TO_GOAL / 2);
  EXPECT_LT(normalised / count, 4.0);
  EXPECT_GT(normalised / count, 0.25);
}

TEST_P(SceneTrackerTest, LearnsTheDepths)
{
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  EXPECT_TRUE(tracker.depths().empty());
  tracker.start(scene.find(scene.image(scene.onTheWay("far", 0.0))), scene.onTheWay("far", 0.0));
  for (int i = 0; i <= STEPS_TO_GOAL / 2; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("far", static_cast<double>(i) / STEPS_TO_GOAL);
    ASSERT_EQ(tracker.add(scene.image(camera), camera).state, TrackingState::TRACKING) << i;
  }
  const double unit = tracker.track().plane->distance.value_or(0.0);
  std::vector<double> errors;
  for (std::size_t i = 0; i < tracker.points().size(); ++i)
  {
    errors.push_back(scene.depthError(tracker.points()[i], tracker.depths()[i] * unit));
  }
  EXPECT_LT(medianOf(errors), 0.005);
  EXPECT_LT(quantileOf(errors, 0.85), 0.03);  // corners on outlines, and such as repeat, may stay wrong
}

TEST_P(SceneTrackerTest, DoesWithoutOdometry)
{
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  tracker.start(scene.find(scene.image(scene.onTheWay("near", 0.0))), std::nullopt);
  for (int i = 0; i <= STEPS_TO_GOAL; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("near", static_cast<double>(i) / STEPS_TO_GOAL);
    const PlaneTrack& track = tracker.add(scene.image(camera), std::nullopt);
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    EXPECT_LT(turnFrom(track.plane->motion.rotation, scene.motion(camera).linear()), 0.1 * DEGREE) << i;
    EXPECT_FALSE(track.plane->distance);
  }
  EXPECT_LT(tracker.track().plane->motion.translation_over_distance.norm(), 2e-4);
}

TEST_P(SceneTrackerTest, KeepsItsDepthsWhenTheSceneIsMoved)
{
  constexpr int MOVED_AT = STEPS_TO_GOAL / 2;
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  tracker.start(scene.find(scene.image(scene.onTheWay("far", 0.0))), scene.onTheWay("far", 0.0));
  // The camera is where the scene is seen from, carried along with it.
  const double way = (scene.onTheWay("far", 0.0).translation() - scene.world.goal.translation()).norm();
  Eigen::Isometry3d carried(Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.2, 0.3, 0.9).normalized()));
  carried.translation() = Eigen::Vector3d(0.6, -0.3, 0.4) * way;
  double before = 0.0;
  for (int i = 0; i <= STEPS_TO_GOAL; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("far", static_cast<double>(i) / STEPS_TO_GOAL);
    const PlaneTrack& track =
        tracker.add(scene.image(camera), i < MOVED_AT ? camera : Eigen::Isometry3d(carried * camera));
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    if (i < MOVED_AT - 1)
    {
      continue;
    }
    ASSERT_TRUE(track.plane->distance) << i;
    before = i < MOVED_AT ? *track.plane->distance : before;
    // That of the virtual plane changes a little with the points that are in sight, also where nothing is moved.
    EXPECT_NEAR(*track.plane->distance / before, 1.0, 0.05) << i;
    const Eigen::Vector3d moved = *track.plane->distance * track.plane->motion.translation_over_distance;
    EXPECT_LT((moved - scene.motion(camera).translation()).norm(), 0.005 * way) << i;
  }
}

TEST_P(SceneTrackerTest, IsNotMisledByWhatHidesAHalf)
{
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  tracker.start(scene.find(scene.image(scene.onTheWay("near", 0.0))), scene.onTheWay("near", 0.0));
  for (int i = 0; i <= STEPS_TO_GOAL; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("near", static_cast<double>(i) / STEPS_TO_GOAL);
    cv::Mat image = scene.image(camera);
    if (i > STEPS_TO_GOAL / 3)
    {
      cv::Mat half = image(cv::Rect(0, 0, image.cols / 2, image.rows));
      cv::randu(half, 0, 256);
    }
    const PlaneTrack& track = tracker.add(image, camera);
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    EXPECT_LT(turnFrom(track.plane->motion.rotation, scene.motion(camera).linear()), 0.2 * DEGREE) << i;
  }
  EXPECT_LT(tracker.track().plane->motion.translation_over_distance.norm(), 1e-3);
}

TEST_P(SceneTrackerTest, IsFoundAgainWithItsDepths)
{
  ViewedWorld scene(GetParam());
  SceneTracker tracker = scene.tracker();
  tracker.start(scene.find(scene.image(scene.onTheWay("far", 0.0))), scene.onTheWay("far", 0.0));
  for (int i = 0; i <= 2 * STEPS_TO_GOAL / 3; ++i)
  {
    const Eigen::Isometry3d camera = scene.onTheWay("far", static_cast<double>(i) / STEPS_TO_GOAL);
    ASSERT_EQ(tracker.add(scene.image(camera), camera).state, TrackingState::TRACKING) << i;
  }
  const std::optional<double> distance = tracker.track().plane->distance;
  ASSERT_TRUE(distance);
  const cv::Mat dark(scene.reference.size(), CV_8UC1, cv::Scalar(20));
  for (int i = 0; i < PlaneTrackerParams().lost_after; ++i)
  {
    EXPECT_NE(tracker.add(dark, scene.world.goal).state, TrackingState::TRACKING);
    EXPECT_FALSE(tracker.track().plane);
  }
  EXPECT_EQ(tracker.track().state, TrackingState::LOST);
  const Eigen::Isometry3d camera = scene.onTheWay("near", 0.2);
  const cv::Mat image = scene.image(camera);
  tracker.start(scene.find(image), camera);
  const PlaneTrack& track = tracker.add(image, camera);
  ASSERT_EQ(track.state, TrackingState::TRACKING);
  ASSERT_TRUE(track.plane->distance);
  EXPECT_NEAR(*track.plane->distance, *distance, 0.01 * *distance);
  EXPECT_LT(turnFrom(track.plane->motion.rotation, scene.motion(camera).linear()), 0.1 * DEGREE);
}

/** A motion that is wrong is not believed. */
TEST_P(SceneTrackerTest, IsNotTrackedWhereItIsNot)
{
  ViewedWorld scene(GetParam());
  const Eigen::Isometry3d camera = scene.onTheWay("far", 0.0);
  const cv::Mat image = scene.image(camera);
  SceneFinder::Answer answer = scene.find(image);
  answer.motion.rotation = answer.motion.rotation * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX());
  SceneTracker tracker = scene.tracker();
  tracker.start(answer, camera);
  EXPECT_EQ(tracker.add(image, camera).state, TrackingState::SEARCHING);
  EXPECT_FALSE(tracker.track().plane);
}

INSTANTIATE_TEST_SUITE_P(Worlds, SceneTrackerTest, testing::Values("parts", "rack"));

TEST(SceneTracker, RefusesWhatItCannotUse)
{
  const ViewedWorld scene("parts");
  PlaneTrackerParams params;
  params.lost_after = 0;
  EXPECT_THROW(scene.tracker(params), std::invalid_argument);
  const Eigen::Matrix3d k = scene.world.camera.k;
  EXPECT_THROW(SceneTracker(scene.reference, cv::Rect(600, 0, 100, 100), k, PlaneTrackerParams()),
               std::invalid_argument);
  EXPECT_THROW(SceneTracker(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)), cv::Rect(), k, PlaneTrackerParams()),
               std::invalid_argument);
  SceneTracker tracker = scene.tracker();
  EXPECT_THROW(tracker.add(cv::Mat(480, 640, CV_8UC3), std::nullopt), std::invalid_argument);
  EXPECT_EQ(tracker.add(scene.reference, std::nullopt).state, TrackingState::SEARCHING) << "nothing was found yet";
}

TEST(TargetTracker, TurnsToTheSceneWhereThereIsDepth)
{
  ViewedWorld scene("rack");
  TargetTracker tracker(scene.reference, scene.world.region, scene.world.camera.k, PlaneTrackerParams(), Target::AUTO);
  const Eigen::Isometry3d camera = scene.onTheWay("near", 0.0);
  const cv::Mat image = scene.image(camera);
  EXPECT_EQ(tracker.add(image, camera).state, TrackingState::SEARCHING);
  EXPECT_EQ(tracker.wanted(), TargetTracker::Search::PLANE);
  tracker.addPlaneSearch(std::nullopt, camera);
  EXPECT_EQ(tracker.wanted(), TargetTracker::Search::SCENE);
  tracker.addSceneSearch(scene.find(image), camera);
  EXPECT_EQ(tracker.add(image, camera).state, TrackingState::TRACKING);
  EXPECT_TRUE(tracker.followsScene());
  EXPECT_EQ(tracker.wanted(), TargetTracker::Search::NONE);
}

TEST(TargetTracker, StaysWithAPlane)
{
  ViewedWorld scene("rice");
  TargetTracker tracker(scene.reference, scene.world.region, scene.world.camera.k, PlaneTrackerParams(), Target::AUTO);
  PlaneTracker plane(scene.reference, scene.world.region, scene.world.camera.k, PlaneTrackerParams());
  const Eigen::Isometry3d camera = scene.onTheWay("near", 0.0);
  const cv::Mat image = scene.image(camera);
  const Eigen::Isometry3d motion = scene.motion(camera);
  const Eigen::Matrix3d k = scene.world.camera.k;
  const Eigen::Matrix3d h =
      k * (motion.linear() + motion.translation() * Eigen::RowVector3d(0, 0, 1 / 0.46)) * k.inverse();
  tracker.addPlaneSearch(h, camera);
  plane.start(h, camera);
  EXPECT_EQ(tracker.add(image, camera).state, TrackingState::TRACKING);
  EXPECT_EQ(tracker.wanted(), TargetTracker::Search::SCENE) << "whether it has depth";
  const SceneFinder::Answer answer = scene.find(image);
  EXPECT_EQ(answer.kind, SceneFinder::Kind::PLANE) << answer.reason;
  tracker.addSceneSearch(answer, camera);
  EXPECT_EQ(tracker.wanted(), TargetTracker::Search::NONE);
  EXPECT_FALSE(tracker.followsScene());
  plane.add(image, camera);
  EXPECT_EQ(tracker.add(image, camera).homography.h, plane.add(image, camera).homography.h);
}

}  // namespace view_servo
