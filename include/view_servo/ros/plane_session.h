// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/rectifier.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/prepared_image.h"

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <memory>
#include <optional>
#include <string>

namespace view_servo
{
/**
 * A stored view whose plane is followed through the images of one camera, with one calibration. It is found in images as they
 * come (PlaneFinder) and tracked in rectified ones (PlaneTracker). Not for several threads at once.
 */
class PlaneSession
{
public:
  /** @throws what Rectifier and PlaneTracker throw, std::runtime_error when nothing is left of the rectified region. */
  PlaneSession(std::shared_ptr<const PreparedImage> view, const sensor_msgs::CameraInfo& info,
               const PlaneTrackerParams& params);

  /** Whether the camera has been calibrated as when the session began, for each image so far and this one. */
  bool isOf(const sensor_msgs::CameraInfo& info);

  /** Before each image. @return how time has gone back, which makes it forget all that was found; empty: it has not. */
  std::string advance(const ros::Time& stamp);

  /** What to ask for the view's place in an image. @param raw as it came. */
  PlaneFinder::Question question(const cv::Mat& raw) const;

  /** Starts tracking where the view was found. @param camera_in_odom of that image. */
  void start(const PlaneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** The next image. @param raw as it came. @param camera_in_odom as in PlaneTracker::add(). */
  const PlaneTrack& add(const cv::Mat& raw, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** The last image with what was found in it, and a text. */
  cv::Mat overlay(const std::string& text) const;

private:
  void reset();

  PlaneTrackerParams params_;
  std::shared_ptr<const PreparedImage> view_;  // as the camera took it
  Rectifier rectifier_;
  cv::Mat reference_;  // without distortion, as all that follows
  cv::Rect region_;
  bool calibration_changed_ = false;
  ros::Time last_stamp_;
  cv::Mat last_image_;
  std::unique_ptr<PlaneTracker> tracker_;
  std::optional<Eigen::Matrix3d> last_h_;  // where the plane was tracked last
  Points path_;                            // of the region's middle, the point that servo_25d leads [px]
};

}  // namespace view_servo
