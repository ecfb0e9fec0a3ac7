// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/tracking/homography_aligner.h"
#include "view_servo/tracking/plane_filter.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of following a plane from image to image. */
struct PlaneTrackerParams
{
  HomographyAlignerParams aligner;
  PlaneFilterParams filter;
  int lost_after = 5;  ///< the plane is lost after this many images in a row without it

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PlaneTrackerParams& params);

enum class TrackingState
{
  SEARCHING,  ///< not found in this image
  TRACKING,   ///< found
  LOST        ///< it was found before, but not in the last `lost_after` images
};

/** What is known after an image. */
struct PlaneTrack
{
  TrackingState state = TrackingState::SEARCHING;
  TrackedHomography homography;        ///< found if and only if the state is TRACKING
  std::optional<PlaneEstimate> plane;  ///< of this image; empty unless TRACKING
};

/**
 * Follows the plane of a stored view through the images of a moving camera (thesis ch. 8). Each homography is predicted
 * by odometry from the last one that was found, ΔH = K (ΔR + Δt nᵀ / d) K⁻¹ with the plane in the frame of that last
 * camera, aligned with the stored view, and added to the filter of plane and motion. Until d is known only the rotation
 * is predicted; without odometry the last homography is the prediction.
 *
 * The search for a hidden plane goes on where odometry predicts it. When that fails for too long, the plane has to be
 * found by other means: start().
 */
class PlaneTracker
{
public:
  /**
   * @param reference the stored view, without distortion; 8-bit, one channel. @param region of it that shows the plane
   * [px]; empty = everywhere. @param k camera matrix of the stored view and of all images, without distortion [px].
   * @throws what HomographyAligner throws, std::invalid_argument with all faults of the parameters.
   */
  PlaneTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
               const PlaneTrackerParams& params);

  /**
   * Sets where the plane was found by other means. While the plane is tracked nothing changes, as tracking is more
   * accurate.
   * @param h x_cur ~ H x_ref [px]. @param camera_in_odom as in add(), of the image in which the plane was found.
   */
  void start(const Eigen::Matrix3d& h, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /**
   * The next image.
   * @param image 8-bit, one channel. @param camera_in_odom pose of the camera at that time in a frame that does not
   * jump, empty where odometry does not know.
   * @throws std::invalid_argument when the image has the wrong type.
   */
  const PlaneTrack& add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** What the last add() returned. */
  const PlaneTrack& track() const
  {
    return track_;
  }

  /** PlaneFilter::cameraPose() after the last image; empty unless the plane is tracked in it. */
  std::optional<CameraPose> cameraPose() const;

  /** The corners of the stored view that are tracked [px]. */
  const std::vector<Eigen::Vector2d>& points() const
  {
    return aligner_.points();
  }

private:
  /** Where the plane was found last. */
  struct Place
  {
    Eigen::Matrix3d h;  // x_cur ~ H x_ref [px]
    std::optional<Eigen::Isometry3d> camera_in_odom;
  };

  Eigen::Matrix3d predict(const std::optional<Eigen::Isometry3d>& camera_in_odom) const;

  PlaneTrackerParams params_;
  Eigen::Matrix3d k_;
  HomographyAligner aligner_;
  PlaneFilter filter_;
  std::optional<Place> last_;
  bool found_once_ = false;  // the plane has been tracked in some image
  int missed_ = 0;           // images in a row without the plane
  PlaneTrack track_;
};

}  // namespace view_servo
