// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/corner_error.h"
#include "support/textured_plane.h"
#include "view_servo/Homography.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/RecognizedViews.h"
#include "view_servo/SceneMatches.h"
#include "view_servo/ServoStatus.h"
#include "view_servo/WantedView.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file What the tests of nodes share: pictures with a known homography, a camera, waiting with a deadline. */

#ifdef VIEW_SERVO_SLOWDOWN
constexpr double SLOWDOWN = VIEW_SERVO_SLOWDOWN;  // of a build with sanitizers
#else
constexpr double SLOWDOWN = 1.0;
#endif
constexpr double DEADLINE = 20.0 * SLOWDOWN;  // [s]; nothing here takes nearly as long on an idle machine

/** For rosbag play: how fast a bag is played, times its own pace; slower where nodes are built with sanitizers. */
inline std::string playRate(double rate)
{
  return "--rate=" + std::to_string(rate / SLOWDOWN);
}

/** Calls `step` and asks `predicate`, often, until it holds or the deadline has passed. Wall time. */
inline bool waitUntil(const std::function<bool()>& predicate, const std::function<void()>& step = nullptr)
{
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(DEADLINE);
  while (ros::ok() && ros::WallTime::now() < deadline)
  {
    if (step)
    {
      step();
    }
    if (predicate())
    {
      return true;
    }
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.02));  // returns as soon as a message is there
  }
  return false;
}

/** Waits for a service, on wall time. */
inline bool waitForService(const std::string& name)
{
  return waitUntil([&] { return ros::service::exists(name, false); });
}

/** Calls a service; no answer fails the test, and is a response as it was made. */
template <typename Service>
typename Service::Response answerOf(const std::string& service, typename Service::Request request)
{
  typename Service::Response response;
  EXPECT_TRUE(callService(service, request, response)) << service << " did not answer";
  return response;
}

/** Expects that success is denied in one line that holds `naming`. */
template <typename Response>
void expectFailure(const Response& response, const std::string& naming)
{
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find(naming), std::string::npos) << response.message << "\ndoes not name " << naming;
  EXPECT_EQ(response.message.find('\n'), std::string::npos) << response.message;
}

/** Where a node keeps its views. */
inline std::filesystem::path viewsDir(const std::string& node)
{
  std::string directory;
  if (!ros::param::get(node + "/views_dir", directory))
  {
    throw std::runtime_error(node + " has no views_dir");
  }
  return directory;
}

/** Removes a directory of views that a launch file made up. */
inline void removeViews(const std::string& node)
{
  std::filesystem::remove_all(viewsDir(node));
}

/** A view with what it must have. */
inline StoredView viewOf(const std::string& name, const cv::Mat& image)
{
  StoredView view;
  view.name = name;
  view.image = image;
  return view;
}

/** Stores a view where a node keeps them, in place of one of that name. */
inline void saveView(const std::string& node, const StoredView& view)
{
  ViewStore(viewsDir(node)).save(view, true);
}

/** What a driver says that wants a view for a goal of its own. */
inline WantedView wantedView(const std::string& view, const std::string& goal)
{
  WantedView message;
  message.header.stamp = ros::Time::now();
  message.view = view;
  message.goal = goal;
  return message;
}

/** Whether a message says why it holds nothing, or what a driver does: people and drivers are told by its reason. */
template <typename Message>
bool givesReason(const Message& /*message*/)
{
  return true;
}
inline bool givesReason(const Homography& message)
{
  return message.valid != 0 || !message.reason.empty();
}
inline bool givesReason(const PointMatches& message)
{
  return message.homography.valid != 0 || !message.reason.empty();
}
inline bool givesReason(const LineMatches& message)
{
  return !message.matches.empty() || !message.reason.empty();
}
inline bool givesReason(const SceneMatches& message)
{
  return !message.found.empty() || !message.reason.empty();
}
inline bool givesReason(const RecognizedViews& message)
{
  return !message.reason.empty() || (!message.views.empty() && message.views[0].verified != 0);
}
inline bool givesReason(const ServoStatus& message)
{
  return !message.reason.empty();
}

/** The messages of a topic; safe to ask while spinner threads receive. It is a failure when one lacks a reason. */
template <typename Message>
class Recorder
{
public:
  explicit Recorder(const std::string& topic) : topic_(topic)
  {
    subscriber_ = ros::NodeHandle().subscribe<Message>(topic, 100, &Recorder::callback, this);
  }
  ~Recorder()
  {
    subscriber_.shutdown();
    for (const Message& message : messages_)
    {
      if (!givesReason(message))
      {
        ADD_FAILURE() << "a message on " << topic_ << " gives no reason:\n" << message;
        break;
      }
    }
  }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  std::deque<Message> messages() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }

  std::optional<Message> last() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.empty() ? std::nullopt : std::optional<Message>(messages_.back());
  }

private:
  void callback(const boost::shared_ptr<const Message>& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(*message);
  }

  mutable std::mutex mutex_;
  std::deque<Message> messages_;
  std::string topic_;
  ros::Subscriber subscriber_;
};

/** The picture seen through `h`, on grey ground, under another light. */
inline cv::Mat warped(const cv::Mat& picture, const Eigen::Matrix3d& h)
{
  cv::Mat result = warpedPicture(picture, h);
  result.convertTo(result, -1, 0.8, 12.0);
  return result;
}

template <typename Array>
Eigen::Matrix3d toMatrix(const Array& rows)
{
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
}

inline sensor_msgs::Image toMono8(const cv::Mat& image)
{
  return toImage(image, sensor_msgs::image_encodings::MONO8, std_msgs::Header());
}

/** Publishes images with their calibration, as a camera's driver does. */
class FakeCamera
{
public:
  explicit FakeCamera(const std::string& name) : frame_id(name + "_optical_frame")
  {
    ros::NodeHandle nh;
    image_publisher_ = nh.advertise<sensor_msgs::Image>(name + "/image_raw", 10);
    info_publisher_ = nh.advertise<sensor_msgs::CameraInfo>(name + "/camera_info", 10);
  }

  bool waitForSubscribers(std::uint32_t count) const
  {
    return waitUntil(
        [&] { return image_publisher_.getNumSubscribers() >= count && info_publisher_.getNumSubscribers() >= count; });
  }

  bool hasSubscribers() const
  {
    return image_publisher_.getNumSubscribers() > 0 || info_publisher_.getNumSubscribers() > 0;
  }

  void publish(const cv::Mat& image, const ros::Time& stamp) const
  {
    const sensor_msgs::CameraInfo info = infoOf(image, stamp);
    publish(toImage(image, sensor_msgs::image_encodings::MONO8, info.header), info);
  }

  void publish(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info) const
  {
    info_publisher_.publish(info);
    image_publisher_.publish(image);
  }

  sensor_msgs::CameraInfo infoOf(const cv::Mat& image, const ros::Time& stamp) const
  {
    sensor_msgs::CameraInfo info;
    info.header.stamp = stamp;
    info.header.frame_id = frame_id;
    info.width = static_cast<std::uint32_t>(image.cols);
    info.height = static_cast<std::uint32_t>(image.rows);
    info.distortion_model = "plumb_bob";
    info.D.assign(5, 0.0);
    const double f = calibrated ? focal_length : 0.0;
    info.K = { f, 0.0, 240.0, 0.0, f, 180.0, 0.0, 0.0, 1.0 };
    info.R = { 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0 };
    info.P = { f, 0.0, 240.0, 0.0, 0.0, f, 180.0, 0.0, 0.0, 0.0, 1.0, 0.0 };
    if (!calibrated)
    {
      info.K.fill(0.0);
    }
    return info;
  }

  std::string frame_id;
  bool calibrated = true;
  double focal_length = 500.0;  // [px]

private:
  ros::Publisher image_publisher_;
  ros::Publisher info_publisher_;
};

/** An image and its calibration, as a camera sends them. */
struct CameraMessages
{
  std::string name;
  sensor_msgs::Image image;
  sensor_msgs::CameraInfo info;
};

/** What a camera should not send: stamps without sense, images and calibrations that contradict themselves. */
inline std::vector<CameraMessages> oddMessages(const FakeCamera& camera, const cv::Mat& picture)
{
  std::vector<CameraMessages> odd;
  const auto add = [&](const std::string& name, const ros::Time& stamp) -> CameraMessages& {
    const sensor_msgs::CameraInfo info = camera.infoOf(picture, stamp);
    odd.push_back({ name, toImage(picture, sensor_msgs::image_encodings::MONO8, info.header), info });
    return odd.back();
  };
  const ros::Time now = ros::Time::now();
  add("stamp 0", ros::Time());
  add("last stamp", ros::Time(4294967295U, 0));
  add("very last stamp", ros::Time(4294967295U, 999999999));
  add("first stamp", ros::Time(0, 1));
  for (int i = 0; i < 3; ++i)
  {
    add("steps of 1 ns", ros::Time(now.sec, now.nsec / 2 + static_cast<std::uint32_t>(i)));
  }
  const auto change = [&](const std::string& name, const std::function<void(CameraMessages&)>& spoil) {
    spoil(add(name, ros::Time::now() + ros::Duration(1e-6 * static_cast<double>(odd.size()))));
  };
  change("no size", [](CameraMessages& messages) {
    messages.image.width = messages.image.height = messages.image.step = 0;
    messages.image.data.clear();
    messages.info.width = messages.info.height = 0;
  });
  change("no rows", [](CameraMessages& messages) {
    messages.image.height = messages.info.height = 0;
    messages.image.data.clear();
  });
  change("too little data", [](CameraMessages& messages) { messages.image.data.resize(10); });
  change("no step", [](CameraMessages& messages) { messages.image.step = 0; });
  change("unknown encoding", [](CameraMessages& messages) { messages.image.encoding = "h264"; });
  change("no encoding", [](CameraMessages& messages) { messages.image.encoding.clear(); });
  change("huge", [](CameraMessages& messages) {
    messages.image.width = messages.info.width = 4294967295U;
    messages.image.height = messages.info.height = 4294967295U;
  });
  for (const double number : { std::nan(""), std::numeric_limits<double>::infinity(), -1.0, 1e308 })
  {
    change("K", [&](CameraMessages& messages) { messages.info.K[0] = number; });
    change("K's middle", [&](CameraMessages& messages) { messages.info.K[2] = number; });
    change("D", [&](CameraMessages& messages) { messages.info.D[0] = number; });
    change("P", [&](CameraMessages& messages) { messages.info.P[0] = number; });
  }
  change("unknown distortion", [](CameraMessages& messages) {
    messages.info.distortion_model = "none of them";
    messages.info.D = { 0.1, 0.2 };
  });
  change("binning", [](CameraMessages& messages) { messages.info.binning_x = messages.info.binning_y = 4294967295U; });
  change("region", [](CameraMessages& messages) {
    messages.info.roi.x_offset = messages.info.roi.width = 4294967295U;
    messages.info.roi.height = 1;
  });
  return odd;
}

/** main() of a test of nodes. */
inline int runTests(int argc, char** argv, const std::string& name)
{
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, name);
  ros::NodeHandle keeps_ros_running;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}

}  // namespace test
}  // namespace view_servo
