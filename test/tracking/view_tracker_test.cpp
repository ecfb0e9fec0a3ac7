// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/view_tracker.h"

#include "sim/renderer.h"
#include "sim/visibility.h"
#include "sim/world_reader.h"
#include "support/shipped_files.h"
#include "support/textured_plane.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** What a wrong prediction is off by. */
const PlanarPose ODOMETRY_ERROR{ 0.02, -0.015, 0.01 };

/**
 * The desk, stored at its goal. Matches are made by ray casting: the true depths of corners, 1 to 3 m away and not
 * tracked by what is tested.
 */
class Desk
{
public:
  Desk()
    : world_(sim::readWorld(test::worldFile("desk"))),
      mount_(world_.camera_on_base),
      camera_(world_, {}, 1),
      reference_(camera_.capture(cameraAt(base())))
  {
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(reference_, corners, 250, 0.01, 8.0);
    for (const cv::Point2f& corner : corners)
    {
      const Eigen::Vector2d pixel(corner.x, corner.y);
      const Eigen::Vector3d ray = world_.camera.normalized(pixel).homogeneous().normalized();
      const Eigen::Isometry3d camera = cameraAt(base());
      const Eigen::Vector3d direction = camera.linear() * ray;
      if (const auto distance = sim::firstHit(world_, camera.translation(), direction))
      {
        pixels_.push_back(pixel);
        points_.emplace_back(camera.translation() + *distance * direction);
      }
    }
  }

  const sim::World& world() const
  {
    return world_;
  }
  const CameraMount& mount() const
  {
    return mount_;
  }
  const cv::Mat& reference() const
  {
    return reference_;
  }

  /** The base pose where the view was stored. */
  PlanarPose base() const
  {
    return toPlanar(world_.goal);
  }

  /** Where most tests track from. */
  PlanarPose nearIt() const
  {
    return baseBefore(0.25, 0.1, 0.03);
  }

  /** A base pose, as seen from the goal. */
  PlanarPose baseBefore(double back, double left, double yaw) const
  {
    return compose(base(), { -back, left, yaw });
  }

  /** What the camera sees from there; the same each time. */
  cv::Mat image(const PlanarPose& base_pose, const sim::Light& light = {})
  {
    const std::vector<double> key{ base_pose.x, base_pose.y, base_pose.yaw, light.gain, light.offset, light.gradient };
    cv::Mat& image = images_[key];
    if (image.empty())
    {
      camera_.setLight(light);
      image = camera_.capture(cameraAt(base_pose));
    }
    return image;
  }

  /** The pose of the stored view's camera in the current one. */
  PlanarPose truth(const PlanarPose& current) const
  {
    return mount_.ofCamera(compose(inverse(current), base()));
  }

  /** Level points of corners that are in sight; with noise in the current image, and unrelated ones besides. */
  Correspondences matches(const PlanarPose& current, double noise_px, int random, Rng& rng) const
  {
    const Eigen::Isometry3d camera = cameraAt(current);
    Correspondences result;
    for (std::size_t i = 0; i < points_.size(); ++i)
    {
      Eigen::Vector2d pixel = world_.camera.project(camera.inverse() * points_[i]);
      const Eigen::Vector3d back = camera.translation() - points_[i];
      const auto hidden = sim::firstHit(world_, points_[i], back.normalized(), 0.01);
      if (!inImage(pixel) || (hidden && *hidden < back.norm()))
      {
        continue;
      }
      pixel.x() += noise_px * gaussian(rng);
      pixel.y() += noise_px * gaussian(rng);
      result.push_back({ levelOf(pixels_[i]), levelOf(pixel) });
    }
    for (int i = 0; i < random; ++i)
    {
      const double u = uniform(rng, 0.0, 639.0);
      result.push_back(
          { levelOf(pixels_[static_cast<std::size_t>(i) % pixels_.size()]), levelOf({ u, uniform(rng, 0.0, 479.0) }) });
    }
    return result;
  }

  /** A tracker that knows the structure, from two views half a metre apart. */
  ViewTracker tracker(const ViewTrackerParams& params = ViewTrackerParams()) const
  {
    ViewTracker result(reference_, world_.camera, mount_, params);
    Rng rng(1);
    const PlanarPose there = baseBefore(0.5, 0.2, 0.05);
    EXPECT_TRUE(result.start(matches(there, 0.3, 0, rng), truth(there)));
    return result;
  }

private:
  Eigen::Isometry3d cameraAt(const PlanarPose& base_pose) const
  {
    return sim::planarPose(base_pose.x, base_pose.y, base_pose.yaw) * world_.camera_on_base;
  }
  bool inImage(const Eigen::Vector2d& pixel) const
  {
    return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < world_.camera.width && pixel.y() < world_.camera.height;
  }
  Eigen::Vector2d levelOf(const Eigen::Vector2d& pixel) const
  {
    return mount_.level(world_.camera.normalized(pixel));
  }

  sim::World world_;
  CameraMount mount_;
  sim::SimulatedCamera camera_;
  cv::Mat reference_;
  Points pixels_;                        // of corners of the stored view
  std::vector<Eigen::Vector3d> points_;  // in the world
  std::map<std::vector<double>, cv::Mat> images_;
};

class ViewTrackerTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    desk_ = std::make_unique<Desk>();
  }
  static void TearDownTestSuite()
  {
    desk_.reset();
  }
  static Desk& desk()
  {
    return *desk_;
  }

  /** Found where it truly is, in metres and radians. */
  static void expectFound(const ViewTracker::Result& result, const PlanarPose& truth, double distance, double angle)
  {
    ASSERT_TRUE(result.found) << result.supporting << " of " << result.looked_for;
    EXPECT_LT(std::hypot(result.pose.x - truth.x, result.pose.y - truth.y), distance);
    EXPECT_LT(std::abs(wrapAngle(result.pose.yaw - truth.yaw)), angle);
    EXPECT_LE(result.supporting, result.looked_for);
    EXPECT_LE(result.rms, ViewTrackerParams().max_residual);
  }

  static PlanarPose wrongly(const PlanarPose& truth)
  {
    return { truth.x + ODOMETRY_ERROR.x, truth.y + ODOMETRY_ERROR.y, truth.yaw + ODOMETRY_ERROR.yaw };
  }

private:
  static std::unique_ptr<Desk> desk_;
};

std::unique_ptr<Desk> ViewTrackerTest::desk_;

/** The image in front of which stripes hide a part from the left. */
cv::Mat covered(const cv::Mat& image, double part)
{
  cv::Mat result = image.clone();
  for (int v = 0; v < image.rows; ++v)
  {
    for (int u = 0; u < static_cast<int>(std::lround(part * image.cols)); ++u)
    {
      result.at<uchar>(v, u) = static_cast<uchar>(60 + 45 * ((v / 17 + u / 23) % 3));
    }
  }
  return result;
}

}  // namespace

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

// ---- tracking

TEST_F(ViewTrackerTest, RecoversThePoseFromAWrongPrediction)
{
  const ViewTracker tracker = desk().tracker();
  for (const PlanarPose& here :
       { desk().baseBefore(0.6, 0.25, 0.06), desk().baseBefore(0.4, -0.2, -0.08), desk().baseBefore(0.2, 0.05, 0.02),
         desk().baseBefore(0.05, 0.0, 0.0), desk().baseBefore(-0.3, 0.05, 0.03) })
  {
    const PlanarPose truth = desk().truth(here);
    const auto result = tracker.track(desk().image(here), wrongly(truth));
    expectFound(result, truth, 0.004 + 0.01 * truth.distance(), 0.15 * DEGREE);
    EXPECT_GT(result.supporting, 0.6 * result.looked_for);
    EXPECT_LT(result.rms, 1.0);
  }
}

TEST_F(ViewTrackerTest, RecoversThePoseFromAPredictionThatIsFarOff)
{
  // The optical flow follows 15 px: what a turn at 0.4 rad/s is off by when image and odometry are 75 ms apart.
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const PlanarPose truth = desk().truth(here);
  for (const double yaw : { -0.03, -0.02, 0.02, 0.03 })
  {
    const auto result = tracker.track(desk().image(here), { truth.x, truth.y, truth.yaw + yaw });
    EXPECT_TRUE(result.found) << yaw;
    EXPECT_LT(std::abs(wrapAngle(result.pose.yaw - truth.yaw)), 0.15 * DEGREE) << yaw;
  }
}

TEST_F(ViewTrackerTest, FindsNoWrongPose)
{
  const ViewTracker tracker = desk().tracker();
  int found = 0;
  for (const PlanarPose& here :
       { desk().baseBefore(0.6, 0.25, 0.06), desk().baseBefore(0.4, -0.2, -0.08), desk().nearIt() })
  {
    const PlanarPose truth = desk().truth(here);
    for (const double y : { -0.15, -0.1, -0.06, 0.0, 0.06, 0.1, 0.15 })
    {
      const auto result = tracker.track(desk().image(here), { truth.x, truth.y + y, truth.yaw });
      if (result.found)
      {
        ++found;
        EXPECT_LT(std::hypot(result.pose.x - truth.x, result.pose.y - truth.y), 0.02) << truth.x << ", " << y;
        EXPECT_LT(std::abs(wrapAngle(result.pose.yaw - truth.yaw)), 0.3 * DEGREE) << truth.x << ", " << y;
      }
    }
  }
  EXPECT_GE(found, 3);
}

TEST_F(ViewTrackerTest, IsExactAtTheView)
{
  const ViewTracker tracker = desk().tracker();
  const auto result = tracker.track(desk().image(desk().base()), { 0.01, -0.01, 0.005 });
  expectFound(result, {}, 0.0008, 0.02 * DEGREE);
  EXPECT_LT(result.displacement, 0.2);
}

TEST_F(ViewTrackerTest, TellsHowFarThePointsAreFromTheirPlace)
{
  const ViewTracker tracker = desk().tracker();
  // A turn by 0.05 moves all by 26 px or a little more.
  const PlanarPose turned = desk().baseBefore(0.0, 0.0, 0.05);
  const auto result = tracker.track(desk().image(turned), desk().truth(turned));
  ASSERT_TRUE(result.found);
  EXPECT_NEAR(result.displacement, 27.0, 2.0);
}

TEST_F(ViewTrackerTest, DoesNotMindTheLight)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const PlanarPose truth = desk().truth(here);
  for (const sim::Light& light :
       { sim::Light{ 0.7, 0.0, 0.0 }, sim::Light{ 1.0, 0.0, 0.6 }, sim::Light{ 0.7, 10.0, -0.5 } })
  {
    expectFound(tracker.track(desk().image(here, light), wrongly(truth)), truth, 0.006, 0.15 * DEGREE);
  }
}

TEST_F(ViewTrackerTest, DoesNotMindNoise)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const PlanarPose truth = desk().truth(here);
  const cv::Mat noisy = test::disturbed(desk().image(here), 1.0, 0.0, 5.0);
  expectFound(tracker.track(noisy, wrongly(truth)), truth, 0.008, 0.15 * DEGREE);
}

TEST_F(ViewTrackerTest, DoesNotMindWhatHidesAPart)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const PlanarPose truth = desk().truth(here);
  const cv::Mat image = desk().image(here);
  const auto open = tracker.track(image, wrongly(truth));
  const auto hidden = tracker.track(covered(image, 0.4), wrongly(truth));
  expectFound(hidden, truth, 0.01, 0.2 * DEGREE);
  EXPECT_LT(hidden.supporting, open.supporting);
}

TEST_F(ViewTrackerTest, FindsNothingWhereNothingIs)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const PlanarPose truth = desk().truth(here);
  const cv::Mat image = desk().image(here);
  EXPECT_TRUE(tracker.track(image, truth).found);
  EXPECT_FALSE(tracker.track(covered(image, 1.0), truth).found);
  EXPECT_FALSE(tracker.track(cv::Mat(image.size(), image.type(), cv::Scalar(0)), truth).found);
  EXPECT_FALSE(tracker.track(cv::Mat(image.size(), image.type(), cv::Scalar(255)), truth).found);
  for (std::uint64_t seed = 1; seed <= 2; ++seed)
  {
    EXPECT_FALSE(tracker.track(test::texturedPicture(seed, image.size()), truth).found) << seed;
  }
  // The same world, seen to the other side.
  EXPECT_FALSE(tracker.track(desk().image(desk().baseBefore(0.25, 0.1, 1.5)), truth).found);
}

TEST_F(ViewTrackerTest, FindsNothingWithAHopelessPrediction)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const cv::Mat image = desk().image(here);
  EXPECT_FALSE(tracker.track(image, { 0.25, -0.1, M_PI }).found);  // behind the camera
  EXPECT_FALSE(tracker.track(image, { 0.25, 1.5, 0.4 }).found);
  const ViewTracker without(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  const auto nothing = without.track(image, desk().truth(here));
  EXPECT_FALSE(nothing.found);
  EXPECT_EQ(nothing.looked_for, 0);
}

/** Before and after it has landmarks. */
TEST_F(ViewTrackerTest, TellsTheShareInSight)
{
  const ViewTracker fresh(desk().reference(), desk().world().camera, desk().mount(), ViewTrackerParams());
  const ViewTracker with_landmarks = desk().tracker();
  const double field = 2.0 * std::atan(0.5 * desk().world().camera.width / desk().world().camera.k(0, 0));
  for (const ViewTracker* tracker : { &fresh, &with_landmarks })
  {
    EXPECT_GT(tracker->shareInSight({}), 0.95);
    for (const double sense : { -1.0, 1.0 })
    {
      const double half = tracker->shareInSight({ 0.0, 0.0, 0.5 * sense * field });
      EXPECT_GT(half, 0.2);
      EXPECT_LT(half, 0.6);
      EXPECT_LT(tracker->shareInSight({ 0.0, 0.0, 1.1 * sense * field }), 0.02);
      EXPECT_LT(tracker->shareInSight({ 0.0, 0.0, 3.0 * sense }), 0.02);
    }
    EXPECT_GT(tracker->shareInSight({ 0.5, 0.0, 0.0 }), 0.9);   // from behind the view
    EXPECT_LT(tracker->shareInSight({ -1.2, 0.0, 0.0 }), 0.9);  // from ahead of it
    EXPECT_EQ(tracker->shareInSight({ -30.0, 0.0, 0.0 }), 0.0);
  }
}

TEST_F(ViewTrackerTest, RefusesImagesOfAnotherSize)
{
  const ViewTracker tracker = desk().tracker();
  const cv::Mat image = desk().image(desk().base());
  EXPECT_THROW(tracker.track(image(cv::Rect(0, 0, 639, 480)), {}), std::invalid_argument);
  EXPECT_THROW(tracker.track(cv::Mat(), {}), std::invalid_argument);
}

TEST_F(ViewTrackerTest, SameImageGivesTheSamePose)
{
  const ViewTracker tracker = desk().tracker();
  const PlanarPose here = desk().nearIt();
  const cv::Mat image = desk().image(here);
  const auto first = tracker.track(image, wrongly(desk().truth(here)));
  const auto second = tracker.track(image, wrongly(desk().truth(here)));
  EXPECT_EQ(first.pose.x, second.pose.x);
  EXPECT_EQ(first.pose.yaw, second.pose.yaw);
  EXPECT_EQ(first.supporting, second.supporting);
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

// ---- parameters

TEST(ViewTrackerParams, NameAllFaultsAtOnce)
{
  EXPECT_TRUE(ViewTrackerParams().validate().empty());
  ViewTrackerParams params;
  params.max_landmarks = 7;
  params.window = 20;
  params.levels = -1;
  params.max_residual = 0.0;
  params.min_supporting = 3;
  params.min_support = 1.1;
  params.max_scale_difference = std::numeric_limits<double>::quiet_NaN();
  params.assumed_depth = 0.0;
  const std::vector<std::string> faults = params.validate();
  ASSERT_EQ(faults.size(), 8U);
  const std::vector<std::string> names{ "max_landmarks",
                                        "tracking_window",
                                        "tracking_levels",
                                        "tracking_max_residual",
                                        "tracking_min_supporting",
                                        "tracking_min_support",
                                        "tracking_max_scale_difference",
                                        "assumed_depth" };
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    EXPECT_EQ(faults[i].find(names[i]), 0U) << faults[i];
  }
}

}  // namespace view_servo
