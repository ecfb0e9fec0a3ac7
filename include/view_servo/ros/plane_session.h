// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/markers.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/scene_finder.h"
#include "view_servo/tracking/target_tracker.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_cache.h"

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
 * Follows a stored view, a plane or a scene with depth, through the images of one camera, with one calibration. The
 * view is searched for in images as they come (PlaneFinder, SceneFinder) and tracked in rectified ones (TargetTracker).
 * A view of another camera is tracked as this one would have taken it. Not for several threads at once.
 */
class PlaneSession
{
public:
  /**
   * @throws std::runtime_error when the view's camera cannot be used (see cameraOf()) or this camera would show
   * nothing of the view's region, and what CameraWarp and TargetTracker throw.
   */
  PlaneSession(const CachedView& view, const sensor_msgs::CameraInfo& info, const PlaneTrackerParams& params,
               Target target);

  /** To be called for each image: whether this one and all before have the calibration that the session began with. */
  bool checkCalibration(const sensor_msgs::CameraInfo& info);

  /** To be called before each image. When time has gone back, all that was found is forgotten. */
  StampOrder::Place checkTime(const ros::Time& stamp);

  /**
   * The question to PlaneFinder of where the view is in an image.
   * @param raw the image as the camera took it, with distortion; 8-bit, one channel.
   */
  PlaneFinder::Question question(const cv::Mat& raw) const;

  /** The question to SceneFinder. @param raw as in question(). */
  SceneFinder::Question sceneQuestion(const cv::Mat& raw);

  /** Which of the two questions should be asked about the last image. */
  TargetTracker::Search wanted() const
  {
    return tracker_->wanted();
  }

  /** Whether the view is followed as a scene with depth. */
  bool followsScene() const
  {
    return tracker_->followsScene();
  }

  /** Tracks from where PlaneFinder found the view, if it did. @param camera_in_odom when that image was taken. */
  void start(const PlaneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** The same with SceneFinder. */
  void start(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /**
   * Tracks the view in the next image.
   * @param raw as in question(). @param camera_in_odom as in PlaneTracker::add().
   */
  const PlaneTrack& add(const cv::Mat& raw, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** TargetTracker::cameraPose(). */
  std::optional<CameraPose> cameraPose() const
  {
    return tracker_->cameraPose();
  }

  /** What is known after the last image, without its header, the camera's pose, and the way that it has gone. */
  PlaneScene scene() const;

  /** Draws what was found in the last image, with a text below. */
  cv::Mat overlay(const std::string& text) const;

private:
  /** Forgets all that was found. */
  void reset();

  PlaneTrackerParams params_;
  Target target_;
  Camera view_camera_;
  Camera camera_;
  std::shared_ptr<const PreparedImage> view_;        // as the camera took it
  std::shared_ptr<const PreparedImage> scene_view_;  // the same for SceneFinder; null until it is asked
  sensor_msgs::CameraInfo info_;                     // what the session began with
  CameraWarp rectification_;
  CameraWarp view_warp_;  // from the view's camera to the rectified one
  cv::Mat reference_;     // without distortion, as all that follows
  cv::Rect region_;       // of reference_ that shows the plane [px]
  bool calibration_changed_ = false;
  StampOrder order_;
  cv::Mat last_image_;  // rectified
  std::unique_ptr<TargetTracker> tracker_;
  std::optional<Eigen::Matrix3d> last_h_;  // where the plane was tracked last, x_cur ~ H x_ref, rectified [px]
  Points path_;  // where the region's middle, which servo_25d leads, has been [px], newest last
};

}  // namespace view_servo
