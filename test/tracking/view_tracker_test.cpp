// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/view_tracker.h"

#include "support/textured_plane.h"
#include "view_servo/parameters/numbers.h"
#include "view_tracker_test.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
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
  const cv::Mat noisy = disturbed(desk().image(here), 1.0, 0.0, 5.0);
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
    EXPECT_FALSE(tracker.track(texturedPicture(seed, image.size()), truth).found) << seed;
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

}  // namespace
}  // namespace test
}  // namespace view_servo
