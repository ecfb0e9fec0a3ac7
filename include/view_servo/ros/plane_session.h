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
 * Follows the plane of a stored view through the images of one camera, with one calibration. The view is searched for
 * in images as they come (PlaneFinder) and tracked in rectified ones (PlaneTracker). Not for several threads at once.
 */
class PlaneSession
{
public:
  /** @throws what Rectifier and PlaneTracker throw, std::runtime_error when the rectified region is empty. */
  PlaneSession(std::shared_ptr<const PreparedImage> view, const sensor_msgs::CameraInfo& info,
               const PlaneTrackerParams& params);

  /** To be called for each image: whether this one and all before have the calibration that the session began with. */
  bool checkCalibration(const sensor_msgs::CameraInfo& info);

  /**
   * To be called before each image. When time has gone back, all that was found is forgotten.
   * @return says by how much time has gone back; empty when it has not.
   */
  std::string checkTime(const ros::Time& stamp);

  /** The question to PlaneFinder of where the view is in an image. @param raw as it came. */
  PlaneFinder::Question question(const cv::Mat& raw) const;

  /** Starts tracking from where PlaneFinder found the view. @param camera_in_odom when that image was taken. */
  void start(const PlaneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** Tracks the plane in the next image. @param raw as it came. @param camera_in_odom as in PlaneTracker::add(). */
  const PlaneTrack& add(const cv::Mat& raw, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** Draws what was found in the last image, with a text below. */
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
