// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/hand_eye_collector.h"
#include "view_servo/Homography.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/ros/transform_source.h"

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <sensor_msgs/CameraInfo.h>

#include <chrono>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Where calibrate_hand_eye and calibrate_mount find what they need. */
struct HandEyeSources
{
  std::string view;          ///< name of the stored view
  std::string views_dir;     ///< directory where it is stored; empty: as viewsDir() says
  std::string base_frame;    ///< of the arm; of odometry for a mobile base
  std::string flange_frame;  ///< of what the camera is mounted on
  std::string camera;        ///< namespace of camera_info
  std::string tracker;       ///< node homography_tracker
  bool on_base = false;      ///< the camera is on a mobile base

  /** The options that name both frames. */
  std::string frameOptions() const
  {
    return on_base ? "--odom-frame and --base" : "--base and --flange";
  }
};

/**
 * Collects poses at which an arm stands still while homography_tracker follows a stored view. Not for several threads
 * at once; messages come by a spinner's thread.
 */
class HandEyeSession
{
public:
  /**
   * Waits a few seconds for all that is needed, and has the tracker follow the view.
   * @param given_up ends all waiting once it is true.
   * @throws std::exception with one line on what is wrong or missing, and what to do.
   */
  HandEyeSession(const ros::NodeHandle& nh, const HandEyeSources& sources, const std::function<bool()>& given_up);

  /**
   * Takes what has come since the last call.
   * @return whether a pose was added. @throws std::runtime_error when the view cannot be followed at all.
   */
  bool update();

  /** Why no pose can be taken now, in one line; empty while the arm moves or stands where a pose has been taken. */
  const std::string& hindrance() const
  {
    return hindrance_;
  }
  /** Whether the arm stands where a pose has been taken already. */
  bool atKnownPose() const
  {
    return collector_.atKnownPose();
  }
  /** The stored view that is followed. */
  const HandEyeView& view() const
  {
    return collector_.view();
  }
  /** The poses taken so far, oldest first. */
  const std::vector<HandEyePose>& poses() const
  {
    return collector_.poses();
  }
  /** frame_id of the camera's images; of its camera_info until one has come. */
  const std::string& cameraFrame() const
  {
    return camera_frame_;
  }
  /** Where tf has the camera on the flange [m]; empty when it does not know that. */
  std::optional<Eigen::Isometry3d> cameraByTf() const;

private:
  using Clock = std::chrono::steady_clock;
  struct Received
  {
    Homography::ConstPtr message;
    Clock::time_point time;  // when it came
  };

  /** Takes one homography; whether a pose was added. */
  bool take(const Homography& message);

  HandEyeSources sources_;
  TransformSource transforms_;
  std::mutex mutex_;  // guards info_ and inbox_
  sensor_msgs::CameraInfo::ConstPtr info_;
  std::deque<Received> inbox_;
  HandEyeCollector collector_;
  std::string camera_frame_;
  std::string hindrance_;
  Clock::time_point last_message_ = Clock::now();
  ros::Subscriber info_subscriber_;
  ros::Subscriber homography_subscriber_;
};

}  // namespace view_servo
