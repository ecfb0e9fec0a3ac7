// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "homography_tracker_test.h"
#include "support/cameras.h"

#include "view_servo/Homography.h"
#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/conversions.h"

#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** The picture on grey ground, so much smaller, at a place. */
Eigen::Matrix3d placed(double scale, double u, double v)
{
  Eigen::Matrix3d h;
  h << scale, 0.0, u, 0.0, scale, v, 0.0, 0.0, 1.0;
  return h;
}

/** As when somebody moves an arm and takes pictures: none is like the one before, and the next one comes late. */
TEST_F(HomographyTrackerNodeTest, FindsTheViewInSingleImagesFarFromEachOther)
{
  follow(placed(0.6, 20.0, 20.0));
  camera_.cover();
  for (const Eigen::Matrix3d& h : { placed(0.5, 140.0, 100.0), placed(0.9, 10.0, 10.0), placed(0.5, 10.0, 110.0),
                                    placed(0.5, 10.0, 110.0), placed(0.7, 80.0, 5.0), placed(0.45, 5.0, 5.0) })
  {
    const ros::Time before = camera_.showOnce(warped(picture(), h));
    expectTracking(h, before);
  }
}

TEST_F(HomographyTrackerNodeTest, FollowsAView)
{
  follow(exampleHomography());
  const Homography found = *homographies_.last();
  EXPECT_EQ(found.header.frame_id, "camera_optical_frame");
  EXPECT_EQ(found.view, "goal");
  EXPECT_EQ(found.state, Homography::TRACKING);
  EXPECT_EQ(found.reason, "");
  EXPECT_EQ(found.h[8], 1.0);
  EXPECT_GT(found.inliers, 30);
  EXPECT_GE(found.matches, found.inliers);
  EXPECT_LT(found.rms_error, 1.0);
  EXPECT_TRUE(std::isfinite(found.rotation.w));
  EXPECT_TRUE(std::isfinite(found.translation_over_distance.x));
  EXPECT_TRUE(std::isnan(found.distance));  // without odometry
  Eigen::Matrix3d moved = exampleHomography();
  for (int i = 0; i < 5; ++i)
  {
    moved(0, 2) += 6.0;
    moved(1, 2) -= 4.0;
    camera_.show(warped(picture(), moved));
    expectTracking(moved);
  }
}

TEST_F(HomographyTrackerNodeTest, DrawsWhatItFollows)
{
  const Recorder<sensor_msgs::Image> overlay("homography_tracker/overlay");
  follow(exampleHomography());
  ASSERT_TRUE(waitUntil([&] { return overlay.last().has_value(); }));
  EXPECT_EQ(overlay.last()->encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(overlay.last()->width, 480u);
}

TEST_F(HomographyTrackerNodeTest, StopsWhenTold)
{
  follow(exampleHomography());
  std_srvs::Trigger service;
  ASSERT_TRUE(callService("homography_tracker/stop", service));
  const Recorder<sensor_msgs::CameraInfo> images("camera/camera_info");
  ASSERT_TRUE(waitUntil([&] { return images.messages().size() > 3; }));
  const ros::Time then = images.last()->header.stamp;
  ASSERT_TRUE(waitUntil([&] { return images.last()->header.stamp > then + ros::Duration(0.3); }));
  EXPECT_LT(homographies_.last()->header.stamp, then);
}

TEST_F(HomographyTrackerNodeTest, RefusesWhatItCannotFollowAndGoesOnWithWhatItFollowed)
{
  follow(exampleHomography());
  const auto refused = [](const SetView::Response& response, const std::string& words) {
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.message.find(words), std::string::npos) << response.message;
  };
  refused(start("unknown"), "unknown");
  refused(start(""), "''");
  refused(start("large"), "640 x 480");
  refused(start("plain"), "corners");
  refused(start("broken"), "broken");
  const ros::Time then = homographies_.last()->header.stamp;
  EXPECT_TRUE(waitUntil([&] { return homographies_.last()->header.stamp > then; }));
  EXPECT_TRUE(homographies_.last()->valid);
  EXPECT_EQ(homographies_.last()->view, "goal");
  camera_.set(false, 0.0);
  EXPECT_TRUE(waitUntil([&] { return start("goal").message.find("not calibrated") != std::string::npos; }));
  camera_.set(true, 0.0);
  const ros::Time later = homographies_.last()->header.stamp;
  EXPECT_TRUE(waitUntil([&] { return homographies_.last()->header.stamp > later; }));
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerNodeTest, FindsTheViewAgainAfterAnOcclusion)
{
  follow(exampleHomography());
  const cv::Mat image = warped(picture(), exampleHomography());
  const ros::Time seen = camera_.show(blank());
  ASSERT_TRUE(waitUntil(
      [&] { return homographies_.last()->header.stamp > seen && homographies_.last()->state == Homography::LOST; }));
  EXPECT_FALSE(homographies_.last()->valid);
  EXPECT_TRUE(std::isnan(homographies_.last()->h[0]));
  EXPECT_TRUE(std::isnan(homographies_.last()->rotation.w));
  EXPECT_FALSE(homographies_.last()->reason.empty());
  ASSERT_TRUE(waitUntil([&] { return homographies_.last()->header.stamp > seen + ros::Duration(2.0); }));
  const ros::Time covered = camera_.show(image);
  ASSERT_TRUE(waitUntil([&] { return homographies_.last()->valid != 0; }));
  EXPECT_LT((homographies_.last()->header.stamp - covered).toSec(), 1.0);
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerNodeTest, FindsTheViewAnewSomewhereElse)
{
  follow(exampleHomography());
  const ros::Time seen = camera_.show(blank());
  ASSERT_TRUE(waitForReason(seen, ""));
  const Eigen::Matrix3d elsewhere = placed(0.6, 180.0, 130.0);
  camera_.show(warped(picture(), elsewhere));
  expectTracking(elsewhere);
}

TEST_F(HomographyTrackerNodeTest, DoesNotFollowAViewThatIsSeenTwice)
{
  const Eigen::Matrix3d left = placed(0.48, 4.0, 90.0);
  const Eigen::Matrix3d right = placed(0.48, 246.0, 90.0);
  const cv::Mat one = warped(picture(), left);
  cv::Mat both = one.clone();
  cv::Mat half = warped(picture(), right).colRange(246, 476);
  half.copyTo(both.colRange(246, 476));
  const ros::Time before = camera_.show(both);
  ASSERT_TRUE(waitUntil([&] { return start("goal").success != 0; }));
  EXPECT_TRUE(waitForReason(before, "seen in two places")) << homographies_.last()->reason;
  for (const Homography& message : homographies_.messages())
  {
    EXPECT_FALSE(message.valid);
    EXPECT_EQ(message.state, Homography::SEARCHING);
  }
  camera_.show(one);
  expectTracking(left);
}

TEST_F(HomographyTrackerNodeTest, LooksAnewWhenTimeGoesBack)
{
  follow(exampleHomography());
  camera_.set(true, 3.0);
  EXPECT_TRUE(waitForReason(ros::Time(1.0), "looks for the view"));
  EXPECT_LT(homographies_.last()->header.stamp, ros::Time::now() - ros::Duration(2.0));
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerNodeTest, FollowsTheViewThatADriverWants)
{
  camera_.show(warped(picture(), exampleHomography()));
  for (const std::string goal : { "goal 1", "goal 2" })
  {
    want("goal", goal);
    ASSERT_TRUE(waitForAnswer(homographies_, goal, [](const Homography& message) { return message.valid != 0; }));
    EXPECT_EQ(homographies_.last()->view, "goal");
    EXPECT_EQ(homographies_.last()->reason, "");
    EXPECT_FALSE(homographies_.last()->refused);
    expectTracking(exampleHomography());
  }
  want("", "goal 2");
  EXPECT_TRUE(waitForSilence());
  want("goal", "goal 3");
  EXPECT_TRUE(waitForAnswer(homographies_, "goal 3", [](const Homography& message) { return message.valid != 0; }));
  ASSERT_TRUE(start("goal").success);
  EXPECT_TRUE(waitForAnswer(homographies_, "", [](const Homography& message) { return message.valid != 0; }));
}

TEST_F(HomographyTrackerNodeTest, NoneFromADriverLeavesAPersonsViewAlone)
{
  follow(exampleHomography());
  want("", "an old goal");
  const std::size_t before = homographies_.messages().size();
  EXPECT_TRUE(waitUntil([&] { return homographies_.messages().size() > before + 30; }));
  EXPECT_TRUE(homographies_.last()->valid);
  EXPECT_EQ(homographies_.last()->view, "goal");
}

TEST_F(HomographyTrackerNodeTest, RefusesWhatADriverCannotHave)
{
  expectRefusal("unknown", "1", "unknown");
  expectRefusal("../goal", "2", "../goal");
  expectRefusal("broken", "3", "broken");
  camera_.show(picture());
  expectRefusal("large", "4", "640 x 480");
  expectRefusal("plain", "5", "corners");
  camera_.set(false, 0.0);
  expectRefusal("goal", "6", "not calibrated");
  const std::size_t before = homographies_.messages().size();
  EXPECT_TRUE(waitUntil([&] { return homographies_.messages().size() >= before + 3; }));  // for who listens later
  camera_.set(true, 0.0);
  expectTracking(Eigen::Matrix3d::Identity());
  EXPECT_EQ(homographies_.last()->goal, "6");
}

TEST_F(HomographyTrackerNodeTest, FollowsAViewOfAnotherCamera)
{
  const Camera here = toCamera(FakeCamera("none").infoOf(picture(), ros::Time()));
  Camera there = pinholeCamera({ 600, 440 }, 430.0, 430.0, 305.0, 215.0);
  there.distortion_model = "equidistant";
  there.distortion.assign(4, 0.0);
  StoredView view = viewOf("fisheye", CameraWarp(here, there).image(picture()));
  view.camera = there;
  saveView("homography_tracker", view);
  camera_.show(warped(picture(), exampleHomography()));
  want("fisheye", "another camera");
  ASSERT_TRUE(waitForAnswer(homographies_, "another camera", [](const Homography& message) {
    return message.valid != 0;
  })) << homographies_.last()->reason;
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerNodeTest, SaysWhatIsLackingUntilItIsThere)
{
  const auto waits = [](const std::string& words) {
    return [words](const Homography& message) {
      return message.valid == 0 && message.refused == 0 && message.reason.find(words) != std::string::npos;
    };
  };
  const Recorder<Homography> lost("lost/homography");
  // The last image of the test before has to grow old.
  ASSERT_TRUE(waitUntil([&] { return start("goal", "lost").message.find("image") != std::string::npos; }));
  want("goal", "early");
  ASSERT_TRUE(waitForAnswer(homographies_, "early", waits("image"))) << homographies_.last()->reason;
  EXPECT_EQ(homographies_.last()->view, "goal");
  EXPECT_EQ(homographies_.last()->header.frame_id, "");
  const std::size_t before = homographies_.messages().size();
  const ros::WallTime start_time = ros::WallTime::now();
  EXPECT_TRUE(waitUntil([&] { return homographies_.messages().size() >= before + 3; }));
  EXPECT_GT((ros::WallTime::now() - start_time).toSec(), 0.8);
  const SetView::Response response = start("goal", "lost");
  EXPECT_TRUE(response.success);
  EXPECT_NE(response.message.find("as soon as it can"), std::string::npos) << response.message;

  camera_.show(picture());
  expectTracking(Eigen::Matrix3d::Identity());
  EXPECT_EQ(homographies_.last()->goal, "early");
  EXPECT_TRUE(waitForAnswer(lost, "", waits("'camera_optical_frame' in 'nowhere'"))) << lost.last()->reason;
  camera_.cover();
  EXPECT_TRUE(waitForAnswer(homographies_, "early", waits("no image comes on '/camera/image_raw'")));
}

TEST_F(HomographyTrackerNodeTest, RefusesImagesOfAnotherCalibrationUntilItIsChosenAnew)
{
  camera_.show(picture());
  want("goal", "before");
  expectTracking(Eigen::Matrix3d::Identity());
  camera_.set(true, 0.0, 510.0);
  expectRefusalOf("goal", "before", "calibration has changed");
  want("goal", "after");
  EXPECT_TRUE(waitForAnswer(homographies_, "after", [](const Homography& message) { return message.valid != 0; }));
  camera_.set(true, 0.0, 500.0);
  expectRefusalOf("goal", "after", "calibration has changed");
  ASSERT_TRUE(start("goal").success);
  EXPECT_TRUE(waitForAnswer(homographies_, "", [](const Homography& message) { return message.valid != 0; }));
}

TEST_F(HomographyTrackerNodeTest, OutlivesWhatACameraShouldNotSend)
{
  const FakeCamera camera("camera");
  ASSERT_TRUE(camera.waitForSubscribers(2));
  const cv::Mat seen = warped(picture(), exampleHomography());
  const auto goes_on = [&] {
    const ros::Time since = ros::Time::now();
    std::optional<std::uint32_t> answered;  // the refusal
    return waitForAnswer(
        homographies_, "goal",
        [&](const Homography& message) {
          return message.valid != 0 && message.header.stamp >= since &&
                 message.header.stamp < since + ros::Duration(DEADLINE);
        },
        [&] {
          camera.publish(seen, ros::Time::now());
          const std::optional<Homography> last = homographies_.last();
          if (last && last->refused && last->header.seq != answered)
          {
            answered = last->header.seq;
            want("goal", "goal");  // it has begun with another calibration
          }
        });
  };
  want("goal", "goal");
  ASSERT_TRUE(goes_on());
  for (const CameraMessages& odd : oddMessages(camera, seen))
  {
    SCOPED_TRACE(odd.name);
    camera.publish(odd.image, odd.info);
    ASSERT_TRUE(goes_on()) << homographies_.last()->reason;
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "homography_tracker_test");
}
