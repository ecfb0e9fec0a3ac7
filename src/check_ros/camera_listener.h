// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/observations.h"
#include "check/stream_meter.h"
#include "check_ros/setup.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/ros_graph.h"

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <opencv2/core/mat.hpp>

#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace view_servo::check
{
/** Time of a steady clock [s]. */
double steadySeconds();

/**
 * Listens to a camera's images and calibrations, also to those that nodes would refuse. Safe to use from several
 * threads.
 */
class CameraListener
{
public:
  CameraListener(const ros::NodeHandle& nh, const Setup& setup);

  /** What came until now. @param duration time since the construction [s]. */
  CameraObservations observations(const RosGraph& graph, double duration) const;

  /** The newest image that came with a calibration of its stamp, if there is one. */
  std::optional<CameraFrame> frame() const;
  /** The newest image as grey; empty without one, or when its encoding cannot be read. */
  cv::Mat picture() const;
  /** frame_id of the newest image; empty without one. */
  std::string frameId() const;
  /** Stamps of the last images, oldest first. */
  std::vector<ros::Time> stamps() const;
  /** Time since the last image came [s]; infinite before the first. */
  double silence() const;
  /** Number of images that have come. */
  int count() const;
  /** What stampsApart() says of odometry's and these images' stamps: why they do not go together; else empty. */
  std::string apart(const DriverInput& odometry) const;

  const CameraTopics& topics() const
  {
    return topics_;
  }

private:
  void onImage(const CameraImageConstPtr& image);
  void onInfo(const sensor_msgs::CameraInfoConstPtr& info);
  /** Two messages with the same stamp. The mutex is held. */
  void pair(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);

  CameraTopics topics_;
  mutable std::mutex mutex_;  // guards what follows, up to the transport
  DriverInput input_;         // of the images, by whose stamps they are judged
  std::string stamp_fault_;   // of the last image
  StreamMeter images_;
  StreamMeter infos_;
  std::deque<CameraImageConstPtr> last_images_;
  std::deque<sensor_msgs::CameraInfoConstPtr> last_infos_;
  double last_time_;                  // when the last image came, by a steady clock [s]
  std::optional<CameraFrame> frame_;  // see frame()
  int pairs_ = 0;                     // images that came with a camera_info of the same stamp

  CameraImageSubscriber image_subscriber_;
  ros::Subscriber info_subscriber_;
};

}  // namespace view_servo::check
