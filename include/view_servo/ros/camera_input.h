// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/parameters.h"

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <image_transport/image_transport.h>
#include <image_transport/subscriber_filter.h>
#include <message_filters/subscriber.h>
#include <message_filters/time_synchronizer.h>
#include <ros/node_handle.h>
#include <ros/wall_timer.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <mutex>
#include <string>

namespace view_servo
{
/** An image with its calibration. */
struct CameraFrame
{
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
};

struct CameraInputParams
{
  std::string image_transport = "raw";  // read by image_transport itself
  int queue_size = 5;
  double max_image_age = 1.0;  // [s]
};

/** Names, units, ranges and meanings of these parameters. */
std::vector<Parameter> parameters(CameraInputParams& params);

/**
 * A node's camera: the newest image that comes with a calibration of the same stamp.
 *
 * Subscribes to `image_raw` (sensor_msgs/Image) and `camera_info` (sensor_msgs/CameraInfo), each of which can be
 * remapped by itself.
 *
 * A frame that cannot be used (camera not calibrated, or calibrated for another size) is dropped, with a throttled
 * error that names both topics; so are messages of which none have a common stamp. An image from the future is as bad
 * as an old one: time jumped back, as when a bag loops.
 */
class CameraInput
{
public:
  using Callback = std::function<void(const CameraFrame&)>;

  /**
   * Both are called from a spinner's thread, and have to be quick.
   * @param on_frame called for every usable frame. @param on_problem called for every other one, with what is wrong.
   */
  CameraInput(const ros::NodeHandle& nh, const CameraInputParams& params, Callback on_frame = Callback(),
              std::function<void(const std::string&)> on_problem = {});

  /** @throws ImageError, saying why, when there is no usable frame or it is too old. */
  CameraFrame latest() const;

  /** What is wrong with latest(), in one line; empty: nothing, and `frame` is it. @param before frame that does not do. */
  std::string missing(CameraFrame& frame, const CameraFrame& before = CameraFrame()) const;
  /** Why the newest image cannot be used with its calibration, whatever it shows; empty: it can, or none came. */
  std::string fault() const;

  /**
   * The same, as soon as there is one: a camera may start later than its node. The wait is by a steady clock, and logged.
   * Only one caller waits at a time, and others are answered at once: who waits takes one of the spinner's few threads, and
   * images come by them, too.
   * @param patience longest wait [s].
   */
  CameraFrame latest(double patience) const;

  /** Where images come from, resolved. */
  std::string imageTopic() const
  {
    return image_subscriber_.getTopic();
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

private:
  void frameCallback(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);
  void take(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);
  std::string faultOf(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info) const;
  void checkInputs();
  std::string topics() const;

  CameraInputParams params_;
  Callback on_frame_;
  std::function<void(const std::string&)> on_problem_;
  mutable std::mutex waiting_mutex_;  // held by the one who waits; taken before mutex_
  mutable std::mutex mutex_;          // guards what follows, up to the transport
  CameraFrame latest_;
  std::string fault_;    // of the last pair
  std::string problem_;  // why the last frame was not usable, or none came
  int images_ = 0;       // since the last check
  int infos_ = 0;
  int pairs_ = 0;
  double rate_ = 0.0;  // of usable frames [Hz]
  int frames_ = 0;     // usable, since the last diagnosis
  ros::WallTime last_diagnosis_;

  image_transport::ImageTransport transport_;
  image_transport::SubscriberFilter image_subscriber_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> info_subscriber_;
  message_filters::TimeSynchronizer<sensor_msgs::Image, sensor_msgs::CameraInfo> synchronizer_;
  ros::WallTimer check_timer_;
};

}  // namespace view_servo
