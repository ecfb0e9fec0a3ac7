// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "node_test.h"

#include "view_servo/Homography.h"
#include "view_servo/SetView.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <std_srvs/Trigger.h>
#include <opencv2/imgproc.hpp>

#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace view_servo
{
namespace test
{
namespace
{
/** A camera that shows a picture at 30 Hz. */
class RunningCamera
{
public:
  RunningCamera() : camera_("camera")
  {
    thread_ = std::thread([this] { run(); });
  }
  ~RunningCamera()
  {
    running_ = false;
    thread_.join();
  }
  RunningCamera(const RunningCamera&) = delete;
  RunningCamera& operator=(const RunningCamera&) = delete;

  /** From now on. @return the stamp of the last image before. */
  ros::Time show(const cv::Mat& picture)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    picture_ = picture;
    return last_;
  }

  void set(bool calibrated, double delay)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    camera_.calibrated = calibrated;
    delay_ = delay;
  }

private:
  void run()
  {
    ros::WallRate rate(30.0);
    while (running_ && ros::ok())
    {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (!picture_.empty())
        {
          last_ = ros::Time::now() - ros::Duration(delay_);
          camera_.publish(picture_, last_);
        }
      }
      rate.sleep();
    }
  }

  std::mutex mutex_;  // guards what follows
  FakeCamera camera_;
  cv::Mat picture_;
  double delay_ = 0.0;  // of stamps [s]
  ros::Time last_;
  std::atomic<bool> running_{ true };
  std::thread thread_;
};

/** The picture on grey ground, so much smaller, at a place. */
Eigen::Matrix3d placed(double scale, double u, double v)
{
  Eigen::Matrix3d h;
  h << scale, 0.0, u, 0.0, scale, v, 0.0, 0.0, 1.0;
  return h;
}

class HomographyTrackerTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    const ViewStore store(viewsDir("homography_tracker"));
    StoredView view;
    view.name = "goal";
    view.image = picture();
    store.save(view, true);
    view.name = "large";
    view.image = makePicture(1, cv::Size(640, 480));
    store.save(view, true);
    view.name = "plain";
    view.image = cv::Mat(picture().size(), CV_8UC1, cv::Scalar(100));
    store.save(view, true);
  }
  static void TearDownTestSuite()
  {
    removeViews("homography_tracker");
  }

  void SetUp() override
  {
    for (const char* service : { "homography_tracker/start", "alone/start", "lost/start", "point_matcher/match" })
    {
      ASSERT_TRUE(waitForService(service));
    }
  }
  void TearDown() override
  {
    std_srvs::Trigger service;
    EXPECT_TRUE(ros::service::call("homography_tracker/stop", service));
    EXPECT_TRUE(service.response.success);
  }

  static cv::Mat picture()
  {
    return makePicture(1);
  }
  static cv::Mat blank()
  {
    return cv::Mat(picture().size(), CV_8UC1, cv::Scalar(40));
  }

  static SetView::Response start(const std::string& view, const std::string& node = "homography_tracker")
  {
    SetView service;
    service.request.view = view;
    EXPECT_TRUE(ros::service::call(node + "/start", service));
    return service.response;
  }

  /** Starts as soon as there are images, and waits until the picture is found where it is. */
  void follow(const Eigen::Matrix3d& h)
  {
    camera_.show(warped(picture(), h));
    std::string message;
    ASSERT_TRUE(waitUntil([&] {
      const SetView::Response response = start("goal");
      message = response.message;
      return response.success != 0;
    })) << message;
    expectTracking(h);
  }

  void expectTracking(const Eigen::Matrix3d& h)
  {
    EXPECT_TRUE(waitUntil([&] {
      const auto last = homographies_.last();
      return last && last->valid != 0 && cornerError(toMatrix(last->h), h) < 2.0;
    })) << (homographies_.last() ? homographies_.last()->reason : "no homography");
  }

  /** Waits for a homography that is not valid, of an image taken after `stamp`, and says why. */
  bool waitForReason(const ros::Time& stamp, const std::string& words)
  {
    return waitUntil([&] {
      const auto last = homographies_.last();
      return last && last->header.stamp > stamp && last->valid == 0 && last->reason.find(words) != std::string::npos;
    });
  }

  RunningCamera camera_;
  Recorder<Homography> homographies_{ "homography" };
};

TEST_F(HomographyTrackerTest, FollowsAView)
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

TEST_F(HomographyTrackerTest, DrawsWhatItFollows)
{
  const Recorder<sensor_msgs::Image> overlay("overlay");
  follow(exampleHomography());
  ASSERT_TRUE(waitUntil([&] { return overlay.last().has_value(); }));
  EXPECT_EQ(overlay.last()->encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(overlay.last()->width, 480u);
}

TEST_F(HomographyTrackerTest, StopsWhenTold)
{
  follow(exampleHomography());
  std_srvs::Trigger service;
  ASSERT_TRUE(ros::service::call("homography_tracker/stop", service));
  const Recorder<sensor_msgs::CameraInfo> images("camera/camera_info");
  ASSERT_TRUE(waitUntil([&] { return images.messages().size() > 3; }));
  const ros::Time then = images.last()->header.stamp;
  ASSERT_TRUE(waitUntil([&] { return images.last()->header.stamp > then + ros::Duration(0.3); }));
  EXPECT_LT(homographies_.last()->header.stamp, then);
}

TEST_F(HomographyTrackerTest, RefusesWhatItCannotFollowAndGoesOnWithWhatItFollowed)
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
  refused(start("goal", "alone"), "/nobody/match");
  refused(start("goal", "lost"), "'camera_optical_frame' in ~odom_frame 'nowhere'");
  const ros::Time then = homographies_.last()->header.stamp;
  EXPECT_TRUE(waitUntil([&] { return homographies_.last()->header.stamp > then; }));
  EXPECT_TRUE(homographies_.last()->valid);
  camera_.set(false, 0.0);
  EXPECT_TRUE(waitUntil([&] { return start("goal").message.find("not calibrated") != std::string::npos; }));
  camera_.set(true, 0.0);
  const ros::Time later = homographies_.last()->header.stamp;
  EXPECT_TRUE(waitUntil([&] { return homographies_.last()->header.stamp > later; }));
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerTest, FindsTheViewAgainAfterAnOcclusion)
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

TEST_F(HomographyTrackerTest, FindsTheViewAnewSomewhereElse)
{
  follow(exampleHomography());
  const ros::Time seen = camera_.show(blank());
  ASSERT_TRUE(waitForReason(seen, ""));
  const Eigen::Matrix3d elsewhere = placed(0.6, 180.0, 130.0);
  camera_.show(warped(picture(), elsewhere));
  expectTracking(elsewhere);
}

TEST_F(HomographyTrackerTest, DoesNotFollowAViewThatIsSeenTwice)
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

TEST_F(HomographyTrackerTest, LooksAnewWhenTimeGoesBack)
{
  follow(exampleHomography());
  camera_.set(true, 3.0);
  EXPECT_TRUE(waitForReason(ros::Time(1.0), "looks for the view"));
  EXPECT_LT(homographies_.last()->header.stamp, ros::Time::now() - ros::Duration(2.0));
  expectTracking(exampleHomography());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "homography_tracker_test");
}
