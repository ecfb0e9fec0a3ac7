// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_tracker.h"

#include "support/camera_pose_error.h"
#include "support/cameras.h"
#include "support/corner_error.h"

#include "sim/textures.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int WIDTH = 640;
constexpr int HEIGHT = 480;
constexpr double DISTANCE = 0.6;  // [m]
constexpr double RATE = 30.0;     // [Hz]

const Eigen::Matrix3d K = test::cameraMatrix(600.0, 600.0, 319.5, 239.5);

/** A picture on a wall, seen by a camera that moves, with the odometry of an arm. */
class Scene
{
public:
  Scene() : picture_(sim::drawTexture("poster", cv::Size(2 * WIDTH, 2 * HEIGHT), 128.0, 20, 5))
  {
    normal_ = Eigen::Vector3d(0.15, -0.1, 1.0).normalized();
    to_reference_ << 1.0, 0.0, -0.5 * WIDTH, 0.0, 1.0, -0.5 * HEIGHT, 0.0, 0.0, 1.0;
  }

  /** In the frame of the stored view: from 0.25 m away, turned, to the view after 3 s, and on. */
  static Eigen::Isometry3d camera(double time)
  {
    const double left = std::cos(M_PI * time / 6.0);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = left * Eigen::Vector3d(0.17, -0.1, -0.12);
    pose.linear() = Eigen::AngleAxisd(0.35 * left, Eigen::Vector3d(0.3, -0.8, 0.4).normalized()).toRotationMatrix();
    return pose;
  }

  Eigen::Matrix3d truth(double time) const
  {
    const Eigen::Isometry3d motion = camera(time).inverse();
    return K * EuclideanHomography{ motion.linear(), motion.translation() / DISTANCE, normal_ }.matrix() * K.inverse();
  }

  /** With noise of 0.2 mm and 0.02 degrees, in a frame of its own. */
  Eigen::Isometry3d odometry(double time)
  {
    Eigen::Isometry3d pose = camera(time);
    pose.translation() += 2e-4 * Eigen::Vector3d(gaussian(rng_), gaussian(rng_), gaussian(rng_));
    pose.linear() *= Eigen::AngleAxisd(0.02 * DEGREE * gaussian(rng_), Eigen::Vector3d::UnitX()).toRotationMatrix();
    return Eigen::Translation3d(0.5, 0.2, 1.0) * Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.6, 0.0, 0.8)) * pose;
  }

  cv::Mat image(const Eigen::Matrix3d& h) const
  {
    cv::Mat matrix;
    cv::eigen2cv(Eigen::Matrix3d(h * to_reference_), matrix);
    cv::Mat seen;
    cv::warpPerspective(picture_, seen, matrix, cv::Size(WIDTH, HEIGHT), cv::INTER_LINEAR, cv::BORDER_REFLECT);
    return seen;
  }
  cv::Mat image(double time) const
  {
    return image(truth(time));
  }

  const Eigen::Vector3d& normal() const
  {
    return normal_;
  }

private:
  cv::Mat picture_;
  Eigen::Vector3d normal_;
  Eigen::Matrix3d to_reference_;
  Rng rng_{ 3 };
};

cv::Mat covered()
{
  return { HEIGHT, WIDTH, CV_8UC1, cv::Scalar(60) };
}

class PlaneTrackerTest : public testing::Test
{
protected:
  Scene scene;
  PlaneTracker tracker{ scene.image(Eigen::Matrix3d::Identity()), cv::Rect(), K, PlaneTrackerParams() };
};

}  // namespace

TEST(PlaneTrackerParams, NameAllFaultsAtOnce)
{
  PlaneTrackerParams params;
  EXPECT_TRUE(params.validate().empty());
  params.aligner.levels = 0;
  params.filter.window = -1.0;
  params.lost_after = 0;
  EXPECT_EQ(params.validate().size(), 3U);
  const Scene scene;
  EXPECT_THROW(PlaneTracker(scene.image(0.0), cv::Rect(), K, params), std::invalid_argument);
}

TEST_F(PlaneTrackerTest, SearchesUntilItIsStarted)
{
  EXPECT_EQ(tracker.add(scene.image(0.0), std::nullopt).state, TrackingState::SEARCHING);
  EXPECT_FALSE(tracker.track().homography.found);
  EXPECT_FALSE(tracker.track().plane);
  // A start that is wrong stays one.
  tracker.start(Eigen::Matrix3d::Identity(), std::nullopt);
  for (int i = 0; i < 20; ++i)
  {
    EXPECT_EQ(tracker.add(covered(), std::nullopt).state, TrackingState::SEARCHING);
  }
}

TEST_F(PlaneTrackerTest, FollowsThePlaneAndLearnsWhereItIs)
{
  tracker.start(scene.truth(0.0), scene.odometry(0.0));
  for (int i = 0; i <= 90; ++i)
  {
    const double time = i / RATE;
    const PlaneTrack& track = tracker.add(scene.image(time), scene.odometry(time));
    ASSERT_EQ(track.state, TrackingState::TRACKING) << time;
    EXPECT_LT(test::largestCornerError(track.homography.h, scene.truth(time), { WIDTH, HEIGHT }), 0.3) << time;
    ASSERT_TRUE(track.plane) << time;
    if (time > 2.0)
    {
      EXPECT_FALSE(track.plane->ambiguous);
      EXPECT_GT(track.plane->motion.normal.dot(scene.normal()), std::cos(1.0 * DEGREE)) << time;
      ASSERT_TRUE(track.plane->distance) << time;
      EXPECT_NEAR(*track.plane->distance, DISTANCE, 0.02 * DISTANCE) << time;
      const Eigen::Isometry3d motion = Scene::camera(time).inverse();
      EXPECT_LT(Eigen::AngleAxisd(Eigen::Matrix3d(track.plane->motion.rotation.transpose() * motion.linear())).angle(),
                0.1 * DEGREE)
          << time;
      EXPECT_LT((DISTANCE * track.plane->motion.translation_over_distance - motion.translation()).norm(), 0.002)
          << time;
    }
  }
}

TEST_F(PlaneTrackerTest, KnowsHowExactTheCamerasPoseIs)
{
  tracker.start(scene.truth(0.0), scene.odometry(0.0));
  double normalised = 0.0;
  int count = 0;
  for (int i = 0; i <= 90; ++i)
  {
    const double time = i / RATE;
    tracker.add(scene.image(time), scene.odometry(time));
    if (const auto pose = tracker.cameraPose())
    {
      normalised += test::normalisedError(*pose, Scene::camera(time));
      ++count;
    }
  }
  EXPECT_GT(count, 20);
  EXPECT_LT(normalised / count, 4.0);
  EXPECT_GT(normalised / count, 0.25);
}

TEST_F(PlaneTrackerTest, DoesWithoutOdometry)
{
  tracker.start(scene.truth(0.0), std::nullopt);
  for (int i = 0; i <= 90; ++i)
  {
    const PlaneTrack& track = tracker.add(scene.image(i / RATE), std::nullopt);
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    EXPECT_LT(test::largestCornerError(track.homography.h, scene.truth(i / RATE), { WIDTH, HEIGHT }), 0.3) << i;
    EXPECT_FALSE(track.plane->distance);
  }
}

/** Seen from aside and from near, what the first pixel of the view shows is behind the camera. */
TEST(PlaneTracker, FollowsAPlaneOfWhichAPartIsBehindTheCamera)
{
  const Scene scene;
  const cv::Rect region(440, 280, 160, 160);
  PlaneTracker tracker(scene.image(Eigen::Matrix3d::Identity()), region, K, PlaneTrackerParams());
  const Eigen::Vector2d middle(520.0, 360.0);
  const Eigen::Vector3d ray = K.inverse() * middle.homogeneous();
  const Eigen::Vector3d seen = ray * (DISTANCE / scene.normal().dot(ray));
  Eigen::Matrix3d camera;  // its axes in the view's frame
  camera.col(2) = Eigen::Vector3d(1.0, 0.0, 1.0).normalized();
  camera.col(0) = Eigen::Vector3d::UnitY().cross(camera.col(2)).normalized();
  camera.col(1) = camera.col(2).cross(camera.col(0));
  const Eigen::Vector3d place = seen - 0.45 * DISTANCE * camera.col(2);
  const EuclideanHomography motion{ camera.transpose(), -camera.transpose() * place / DISTANCE, scene.normal() };
  const Eigen::Matrix3d h = K * motion.matrix() * K.inverse();
  ASSERT_LT(h(2, 2), 0.0);
  ASSERT_TRUE(transfer(h, middle).allFinite());
  tracker.start(h, std::nullopt);
  for (int i = 0; i < 3; ++i)
  {
    const PlaneTrack& track = tracker.add(scene.image(h), std::nullopt);
    ASSERT_EQ(track.state, TrackingState::TRACKING) << i;
    EXPECT_LT((transfer(track.homography.h, middle) - transfer(h, middle)).norm(), 0.5) << i;
  }
}

/** Odometry tells of jumps that the images alone could not follow. */
TEST_F(PlaneTrackerTest, JumpsWithOdometry)
{
  PlaneTracker alone(scene.image(Eigen::Matrix3d::Identity()), cv::Rect(), K, PlaneTrackerParams());
  int followed_alone = 0;
  tracker.start(scene.truth(0.0), scene.odometry(0.0));
  alone.start(scene.truth(0.0), std::nullopt);
  // Far enough for the distance to be known, then now and then.
  std::vector<double> times;
  for (int i = 0; i <= 20; ++i)
  {
    times.push_back(0.1 * i);
  }
  times.insert(times.end(), { 2.8, 3.6, 4.4, 5.2 });
  for (const double time : times)
  {
    const PlaneTrack& track = tracker.add(scene.image(time), scene.odometry(time));
    ASSERT_EQ(track.state, TrackingState::TRACKING) << time;
    EXPECT_LT(test::largestCornerError(track.homography.h, scene.truth(time), { WIDTH, HEIGHT }), 0.3) << time;
    if (time > 2.05)
    {
      followed_alone += alone.add(scene.image(time), std::nullopt).state == TrackingState::TRACKING ? 1 : 0;
    }
    else
    {
      alone.add(scene.image(time), std::nullopt);
    }
  }
  EXPECT_LT(followed_alone, 4);
}

/** The camera goes on for two seconds while nothing is seen. */
TEST_F(PlaneTrackerTest, FindsThePlaneAgainWhereOdometrySaysItIs)
{
  PlaneTrackerParams params;
  tracker.start(scene.truth(0.0), scene.odometry(0.0));
  int missed = 0;
  for (int i = 0; i <= 150; ++i)
  {
    const double time = i / RATE;
    const bool hidden = time >= 2.1 && time < 4.1;
    const PlaneTrack& track = tracker.add(hidden ? covered() : scene.image(time), scene.odometry(time));
    if (!hidden)
    {
      ASSERT_EQ(track.state, TrackingState::TRACKING) << time;
      EXPECT_LT(test::largestCornerError(track.homography.h, scene.truth(time), { WIDTH, HEIGHT }), 0.3) << time;
      continue;
    }
    ++missed;
    EXPECT_EQ(track.state, missed < params.lost_after ? TrackingState::SEARCHING : TrackingState::LOST) << time;
    EXPECT_FALSE(track.homography.found);
    EXPECT_FALSE(track.homography.h.allFinite());
    EXPECT_FALSE(track.plane);
  }
  EXPECT_GE(missed, 59);
}

TEST_F(PlaneTrackerTest, ANewStartHelpsOnlyWhereItIsLost)
{
  tracker.start(scene.truth(0.0), std::nullopt);
  ASSERT_EQ(tracker.add(scene.image(0.0), std::nullopt).state, TrackingState::TRACKING);
  const Eigen::Matrix3d wrong = Eigen::Vector3d(0.3, 0.3, 1.0).asDiagonal();
  tracker.start(wrong, std::nullopt);
  EXPECT_EQ(tracker.add(scene.image(0.03), std::nullopt).state, TrackingState::TRACKING);
  // It is elsewhere, far away.
  for (int i = 0; i < 10; ++i)
  {
    EXPECT_NE(tracker.add(scene.image(3.0), std::nullopt).state, TrackingState::TRACKING) << i;
  }
  EXPECT_EQ(tracker.track().state, TrackingState::LOST);
  tracker.start(scene.truth(3.0), std::nullopt);
  EXPECT_EQ(tracker.add(scene.image(3.0), std::nullopt).state, TrackingState::TRACKING);
}

TEST_F(PlaneTrackerTest, RefusesWrongImages)
{
  tracker.start(scene.truth(0.0), std::nullopt);
  EXPECT_THROW(tracker.add(cv::Mat(), std::nullopt), std::invalid_argument);
  EXPECT_THROW(tracker.add(cv::Mat(HEIGHT, WIDTH, CV_8UC3), std::nullopt), std::invalid_argument);
}

}  // namespace view_servo
