// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "node_test.h"
#include "support/temporary_directory.h"

#include "test_paths.h"
#include "view_servo/Homography.h"
#include "view_servo/SetView.h"
#include "view_servo/WantedView.h"
#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <std_srvs/Trigger.h>
#include <opencv2/imgproc.hpp>

#include <atomic>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

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

  /** In one image; then nothing. @return the stamp of the last image before. */
  ros::Time showOnce(const cv::Mat& picture)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    picture_ = picture;
    once_ = true;
    return last_;
  }

  /** Shows nothing any more. */
  void cover()
  {
    show(cv::Mat());
  }

  void set(bool calibrated, double delay, double focal_length = 500.0)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    camera_.calibrated = calibrated;
    camera_.focal_length = focal_length;
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
          if (std::exchange(once_, false))
          {
            picture_ = cv::Mat();
          }
        }
      }
      rate.sleep();
    }
  }

  std::mutex mutex_;  // guards what follows
  FakeCamera camera_;
  cv::Mat picture_;
  bool once_ = false;
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
    view.image = texturedPicture(1, cv::Size(640, 480));
    store.save(view, true);
    view.name = "plain";
    view.image = cv::Mat(picture().size(), CV_8UC1, cv::Scalar(100));
    store.save(view, true);
    view.name = "broken";
    store.save(view, true);
    std::ofstream(store.directory() / "broken.yaml") << "image: [";
  }
  static void TearDownTestSuite()
  {
    removeViews("homography_tracker");
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitForService("homography_tracker/start"));
    ASSERT_TRUE(waitForService("lost/start"));
    ASSERT_TRUE(waitUntil([&] { return wanted_.getNumSubscribers() >= 2; }));
  }
  void TearDown() override
  {
    for (const std::string node : { "homography_tracker", "lost" })
    {
      std_srvs::Trigger service;
      EXPECT_TRUE(callService(node + "/stop", service));
      EXPECT_TRUE(service.response.success);
    }
  }

  static cv::Mat picture()
  {
    return texturedPicture(1);
  }
  static cv::Mat blank()
  {
    return cv::Mat(picture().size(), CV_8UC1, cv::Scalar(40));
  }

  static SetView::Response start(const std::string& view, const std::string& node = "homography_tracker")
  {
    SetView service;
    service.request.view = view;
    EXPECT_TRUE(callService(node + "/start", service));
    return service.response;
  }

  /** What a driver does. */
  void want(const std::string& view, const std::string& goal) const
  {
    WantedView message;
    message.header.stamp = ros::Time::now();
    message.view = view;
    message.goal = goal;
    wanted_.publish(message);
  }

  /** Waits for a message about a goal that is as it should be. */
  static bool waitForAnswer(const Recorder<Homography>& homographies, const std::string& goal,
                            const std::function<bool(const Homography&)>& is_right,
                            const std::function<void()>& step = nullptr)
  {
    return waitUntil(
        [&] {
          const std::optional<Homography> last = homographies.last();
          return last && last->goal == goal && is_right(*last);
        },
        step);
  }

  /** Wants a view, and waits until it is refused. */
  void expectRefusal(const std::string& view, const std::string& goal, const std::string& words) const
  {
    SCOPED_TRACE(view);
    want(view, goal);
    expectRefusalOf(view, goal, words);
  }

  void expectRefusalOf(const std::string& view, const std::string& goal, const std::string& words) const
  {
    EXPECT_TRUE(waitForAnswer(homographies_, goal, [&](const Homography& message) {
      return message.refused && message.reason.find(words) != std::string::npos;
    })) << (homographies_.last() ? homographies_.last()->reason : "no message");
    const Homography last = *homographies_.last();
    EXPECT_EQ(last.view, view);
    EXPECT_EQ(last.state, Homography::SEARCHING);
    EXPECT_FALSE(last.valid);
    EXPECT_TRUE(std::isnan(last.h[0]));
    EXPECT_EQ(last.reason.find('\n'), std::string::npos) << last.reason;
  }

  /** Waits until images are not answered any more. */
  bool waitForSilence() const
  {
    const Recorder<sensor_msgs::CameraInfo> images("camera/camera_info");
    return waitUntil([&] {
      const auto last = images.last();
      return last && last->header.stamp > homographies_.last()->header.stamp + ros::Duration(0.7);
    });
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

  /** Waits for the view where it is, in an image taken after a time. */
  void expectTracking(const Eigen::Matrix3d& h, const ros::Time& after = ros::Time())
  {
    EXPECT_TRUE(waitUntil([&] {
      const auto last = homographies_.last();
      return last && last->valid != 0 && last->header.stamp > after && cornerError(toMatrix(last->h), h) < 2.0;
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
  Recorder<Homography> homographies_{ "homography_tracker/homography" };
  const ros::Publisher wanted_ = ros::NodeHandle().advertise<WantedView>("wanted_view", 1, true);
};

/** As when somebody moves an arm and takes pictures: none is like the one before, and the next one comes late. */
TEST_F(HomographyTrackerTest, FindsTheViewInSingleImagesFarFromEachOther)
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
  const Recorder<sensor_msgs::Image> overlay("homography_tracker/overlay");
  follow(exampleHomography());
  ASSERT_TRUE(waitUntil([&] { return overlay.last().has_value(); }));
  EXPECT_EQ(overlay.last()->encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(overlay.last()->width, 480u);
}

TEST_F(HomographyTrackerTest, StopsWhenTold)
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

TEST_F(HomographyTrackerTest, FollowsTheViewThatADriverWants)
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

TEST_F(HomographyTrackerTest, NoneFromADriverLeavesAPersonsViewAlone)
{
  follow(exampleHomography());
  want("", "an old goal");
  const std::size_t before = homographies_.messages().size();
  EXPECT_TRUE(waitUntil([&] { return homographies_.messages().size() > before + 30; }));
  EXPECT_TRUE(homographies_.last()->valid);
  EXPECT_EQ(homographies_.last()->view, "goal");
}

TEST_F(HomographyTrackerTest, RefusesWhatADriverCannotHave)
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

TEST_F(HomographyTrackerTest, FollowsAViewOfAnotherCamera)
{
  const Camera here = toCamera(FakeCamera("none").infoOf(picture(), ros::Time()));
  Camera there;
  there.width = 600;
  there.height = 440;
  there.k << 430.0, 0.0, 305.0, 0.0, 430.0, 215.0, 0.0, 0.0, 1.0;
  there.distortion_model = "equidistant";
  there.distortion.assign(4, 0.0);
  StoredView view;
  view.name = "fisheye";
  view.image = CameraWarp(here, there).image(picture());
  view.camera = there;
  ViewStore(viewsDir("homography_tracker")).save(view, true);
  camera_.show(warped(picture(), exampleHomography()));
  want("fisheye", "another camera");
  ASSERT_TRUE(waitForAnswer(homographies_, "another camera", [](const Homography& message) {
    return message.valid != 0;
  })) << homographies_.last()->reason;
  expectTracking(exampleHomography());
}

TEST_F(HomographyTrackerTest, SaysWhatIsLackingUntilItIsThere)
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

TEST_F(HomographyTrackerTest, RefusesImagesOfAnotherCalibrationUntilItIsChosenAnew)
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

TEST_F(HomographyTrackerTest, OutlivesWhatACameraShouldNotSend)
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

/** Nodes that the test starts itself. */
class TrackerProcessTest : public HomographyTrackerTest
{
protected:
  std::vector<std::string> command(const std::string& name, const std::vector<std::string>& more = {}) const
  {
    std::vector<std::string> words{ HOMOGRAPHY_TRACKER_PATH,
                                    "__name:=" + name,
                                    "_odom_frame:=",
                                    "_views_dir:=" + viewsDir("homography_tracker").string(),
                                    "image_raw:=camera/image_raw",
                                    "camera_info:=camera/camera_info" };
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::string output() const
  {
    return directory_.path() / "output";
  }

  TemporaryDirectory directory_;
};

TEST_F(TrackerProcessTest, FollowsWhatWasWantedBeforeItStarted)
{
  camera_.show(picture());
  want("goal", "long ago");
  const ChildProcess node(command("late"), output());
  const Recorder<Homography> homographies("late/homography");
  EXPECT_TRUE(waitForAnswer(homographies, "long ago", [](const Homography& message) { return message.valid != 0; }))
      << node.output();
}

TEST_F(TrackerProcessTest, FollowsItsParameterUntilADriverWantsAnother)
{
  const ChildProcess node(command("told", { "_view:=unknown" }), output());
  const Recorder<Homography> homographies("told/homography");
  EXPECT_TRUE(waitForAnswer(homographies, "", [](const Homography& message) {
    return message.refused && message.view == "unknown";
  })) << node.output();
  camera_.show(picture());
  want("goal", "goal");
  EXPECT_TRUE(waitForAnswer(homographies, "goal", [](const Homography& message) { return message.valid != 0; }));
}

TEST_F(TrackerProcessTest, EndsAtOnceWhileItLooksForTheView)
{
  camera_.show(texturedPicture(9));
  ChildProcess node(command("ending", { "_match_period:=0.001", "_view:=goal" }), output());
  const Recorder<Homography> homographies("ending/homography");
  ASSERT_TRUE(waitForAnswer(homographies, "", [](const Homography& message) {
    return message.reason.find("geometry") != std::string::npos;
  })) << node.output();
  const ros::WallTime start_time = ros::WallTime::now();
  node.interrupt();
  EXPECT_EQ(node.exitStatus(), 0) << node.output();
  EXPECT_LT((ros::WallTime::now() - start_time).toSec(), 2.0 * SLOWDOWN);
}

TEST_F(TrackerProcessTest, ListsAllFaultsOfItsParameters)
{
  ChildProcess node(command("faulty", { "_match_period:=0", "_matching/coefficients:=7", "_matching/assignment:=lucky",
                                        "_tf_patience:=-1", "_matching/max_cornes:=3" }),
                    output());
  EXPECT_EQ(node.exitStatus(), 1);
  for (const char* words : { "~match_period", "coefficients", "~matching/assignment", "~tf_patience",
                             "~matching/max_cornes", "~matching/max_corners?" })
  {
    EXPECT_NE(node.output().find(words), std::string::npos) << words << " is missing in\n" << node.output();
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "homography_tracker_test");
}
