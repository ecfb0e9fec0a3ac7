// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file What a matcher makes of cameras that send something odd, too late, or not all. */
#include "streaming_test.h"

#include "view_servo/MatchPoints.h"
#include "view_servo/SaveView.h"
#include "view_servo/ros/camera_input.h"

#include <gtest/gtest.h>
#include <ros/callback_queue.h>

#include <atomic>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
TEST_F(StreamingTest, PublishesNothingForAnUncalibratedCamera)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last().has_value(); }, [&] { left_.send(seen_); }));

  left_.camera.calibrated = false;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const ros::Time since = ros::Time::now();
  EXPECT_TRUE(waitUntil(
      [&] {
        return reported(diagnostics, "left/point_matcher",
                        { "not calibrated", "/left/camera/image_raw", "/left/camera/camera_info" });
      },
      [&] { left_.send(seen_); }));
  EXPECT_LE(left_.matches.last()->header.stamp, since);

  MatchPoints::Request request;
  request.reference.view = "wall";
  const MatchPoints::Response response = left_.call<MatchPoints>("point_matcher/match", request);
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find("/left/camera/camera_info"), std::string::npos) << response.message;

  SaveView::Request save;
  save.name = "never";
  EXPECT_FALSE(left_.call<SaveView>("view_store/save", save).success);
}

TEST_F(StreamingTest, MatchesTheLatestImageOnRequestUnlessItIsStale)
{
  left_.teach("wall", picture_);
  MatchPoints::Request request;
  request.reference.view = "wall";
  MatchPoints::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return response.success && cornerError(toMatrix(response.model_matrix), exampleHomography()) < 1.5;
      },
      [&] { left_.send(seen_); }))
      << response.message;

  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return !response.success && response.message.find("old") != std::string::npos;
      },
      [&] { left_.camera.publish(seen_, ros::Time::now() - ros::Duration(10.0)); }))
      << response.message;
  EXPECT_NE(response.message.find("max_image_age"), std::string::npos) << response.message;
}

TEST_F(StreamingTest, OutlivesWhatACameraShouldNotSend)
{
  left_.teach("wall", picture_);
  left_.want("wall", "goal");
  const auto goes_on = [&] {
    const ros::Time since = ros::Time::now();
    return waitUntil(
        [&] {
          const std::optional<PointMatches> last = left_.matches.last();
          return last && last->header.stamp >= since && last->header.stamp < since + ros::Duration(DEADLINE) &&
                 last->homography.valid;
        },
        [&] { left_.send(seen_); });
  };
  ASSERT_TRUE(goes_on());
  for (const CameraMessages& odd : oddMessages(left_.camera, seen_))
  {
    SCOPED_TRACE(odd.name);
    left_.camera.publish(odd.image, odd.info);
    ASSERT_TRUE(goes_on());
  }

  // What is wrong with an image is said.
  CameraMessages torn{ "", toMono8(seen_), left_.camera.infoOf(seen_, ros::Time::now()) };
  torn.image.data.resize(10);
  EXPECT_TRUE(waitUntil(
      [&] {
        const std::optional<PointMatches> last = left_.matches.last();
        return last && !last->refused && last->goal == "goal" && last->reason.find("bytes") != std::string::npos;
      },
      [&] {
        torn.image.header = torn.info.header = left_.camera.infoOf(seen_, ros::Time::now()).header;
        left_.camera.publish(torn.image, torn.info);
      }))
      << left_.matches.last()->reason;
}

TEST_F(StreamingTest, NamesBothTopicsWhenTheirStampsDifferOrOneIsSilent)
{
  ros::NodeHandle nh;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ros::Publisher images = nh.advertise<sensor_msgs::Image>("right/camera/image_raw", 1);
  ros::Publisher infos = nh.advertise<sensor_msgs::CameraInfo>("right/camera/camera_info", 1);
  const auto told = [&](const std::string& words) {
    return [&diagnostics, words] {
      return reported(diagnostics, "right/point_matcher",
                      { words, "/right/camera/image_raw", "/right/camera/camera_info" });
    };
  };
  const auto send_image = [&] {
    sensor_msgs::Image image = toMono8(picture_);
    image.header.stamp = ros::Time::now();
    images.publish(image);
  };
  const auto send_info = [&] {
    infos.publish(FakeCamera("none").infoOf(picture_, ros::Time::now() - ros::Duration(1.0)));
  };
  EXPECT_TRUE(waitUntil(told("no camera_info comes on"), send_image));
  EXPECT_TRUE(waitUntil(told("no image comes on"), send_info));
  EXPECT_TRUE(waitUntil(told("same stamp"), [&] {
    send_image();
    send_info();
  }));
}

/** As of a bag that is played without its calibration, and then again with it. */
TEST_F(StreamingTest, PairsAreFoundAgainAfterTimeHasGoneBack)
{
  std::atomic<int> frames = 0;
  const CameraInput input(ros::NodeHandle("again"), ros::NodeHandle("~"), CameraInputParams(),
                          [&](const CameraFrame&) { ++frames; });
  const ros::Publisher images = ros::NodeHandle().advertise<sensor_msgs::Image>("again/image_raw", 5);
  const ros::Publisher infos = ros::NodeHandle().advertise<sensor_msgs::CameraInfo>("again/camera_info", 5);
  const Recorder<sensor_msgs::Image> heard("again/image_raw");
  double time = 200.0;  // of stamps [s]
  const auto send = [&](bool with_info) {
    time += 0.03;
    const sensor_msgs::CameraInfo info = FakeCamera("none").infoOf(picture_, ros::Time(time));
    images.publish(toImage(picture_, sensor_msgs::image_encodings::MONO8, info.header));
    if (with_info)
    {
      infos.publish(info);
    }
  };
  ASSERT_TRUE(waitUntil([&] { return heard.messages().size() > 8; }, [&] { send(false); }));
  EXPECT_EQ(frames, 0);
  time = 100.0;
  EXPECT_TRUE(waitUntil([&] { return frames > 3; }, [&] { send(true); }));
}

TEST_F(StreamingTest, CalibrationsThatAreHeardAfterAllTheirImagesAreNotMissing)
{
  constexpr std::size_t WAITING = 5;
  // Nothing is heard of what comes to this queue before the test asks it.
  ros::CallbackQueue queue;
  ros::NodeHandle nh("busy");
  nh.setCallbackQueue(&queue);
  std::size_t frames = 0;
  std::vector<std::string> problems;
  const CameraInput input(
      nh, ros::NodeHandle("~"), CameraInputParams(), [&](const CameraFrame&) { ++frames; },
      [&](const std::string& problem) { problems.push_back(problem); });
  const Recorder<sensor_msgs::Image> images("busy/image_raw");
  const Recorder<sensor_msgs::CameraInfo> infos("busy/camera_info");
  const ros::Publisher image_publisher = ros::NodeHandle().advertise<sensor_msgs::Image>("busy/image_raw", WAITING);
  const ros::Publisher info_publisher =
      ros::NodeHandle().advertise<sensor_msgs::CameraInfo>("busy/camera_info", WAITING);
  ASSERT_TRUE(
      waitUntil([&] { return image_publisher.getNumSubscribers() > 0 && info_publisher.getNumSubscribers() > 0; }));
  std::vector<sensor_msgs::CameraInfo> waiting;
  for (std::size_t i = 0; i < WAITING; ++i)
  {
    waiting.push_back(FakeCamera("none").infoOf(picture_, ros::Time(100.0 + 0.03 * static_cast<double>(i))));
    image_publisher.publish(toImage(picture_, sensor_msgs::image_encodings::MONO8, waiting.back().header));
  }
  ASSERT_TRUE(waitUntil([&] { return images.messages().size() == WAITING; }));
  for (const sensor_msgs::CameraInfo& info : waiting)
  {
    info_publisher.publish(info);
  }
  ASSERT_TRUE(waitUntil([&] { return infos.messages().size() == WAITING; }));
  queue.callAvailable();
  EXPECT_EQ(frames, WAITING);
  EXPECT_TRUE(problems.empty()) << problems.front();
  EXPECT_EQ(input.problem(), "");
}

}  // namespace
}  // namespace test
}  // namespace view_servo
