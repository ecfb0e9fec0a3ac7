// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "support/text_file.h"

#include "view_servo/Homography.h"
#include "view_servo/SetView.h"
#include "view_servo/WantedView.h"

#include <gtest/gtest.h>
#include <sensor_msgs/CameraInfo.h>
#include <std_srvs/Trigger.h>
#include <opencv2/core.hpp>

#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

namespace view_servo
{
namespace test
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

/** The nodes homography_tracker and lost of homography_tracker.test, with views, and the camera that they listen to. */
class HomographyTrackerNodeTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    const std::string node = "homography_tracker";
    saveView(node, viewOf("goal", picture()));
    saveView(node, viewOf("large", texturedPicture(1, cv::Size(640, 480))));
    saveView(node, viewOf("plain", cv::Mat(picture().size(), CV_8UC1, cv::Scalar(100))));
    writeText(viewsDir(node) / "broken.yaml", "image: [");
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
    SetView::Request request;
    request.view = view;
    return answerOf<SetView>(node + "/start", request);
  }

  /** What a driver does. */
  void want(const std::string& view, const std::string& goal) const
  {
    wanted_.publish(wantedView(view, goal));
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

}  // namespace test
}  // namespace view_servo
