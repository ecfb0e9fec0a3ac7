// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/scene_finder.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <memory>
#include <optional>
#include <vector>

namespace view_servo
{
/**
 * Follows a stored view of a scene with depth through the images of a moving camera, with all six degrees of freedom.
 * The patches of the view's corners are looked for where the last pose and odometry predict them, seen as the surface
 * there would look from the predicted pose (inverse compositional alignment, Baker & Matthews 2004), and the pose that
 * explains where they are found is fitted. Points are always compared with the stored view itself, so nothing drifts.
 * At the view all displacements are zero whatever the depths, so that the pose becomes exact there.
 *
 * Depths of the corners, in a unit of their own, begin with the matches of a SceneFinder, and are improved together
 * with the poses from which they were seen while the camera moves (bundle adjustment of up to 16 images). The unit's
 * length follows from odometry, as a plane's distance does in PlaneFilter.
 *
 * What is found is told as the homography of a virtual plane: the one parallel to the stored view's image through the
 * chosen point, at about the depth of the things there. A point of it moves as a thing there would, and that is all
 * that 2.5D servoing asks of its chosen point. Its motion and rotation are those of the whole scene.
 *
 * Options are those of PlaneTracker; `refine`, `max_measurements` and `decision` say nothing here.
 */
class SceneTracker
{
public:
  /**
   * @param reference the stored view, without distortion; 8-bit, one channel. @param region of it that is followed
   * [px]; empty = everywhere; its middle is the chosen point. @param k camera matrix of the stored view and of all
   * images, without distortion [px].
   * @throws std::invalid_argument with all faults of the parameters, when the reference has the wrong type, the region
   * leaves it or it has too few corners.
   */
  SceneTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
               const PlaneTrackerParams& params);
  ~SceneTracker();

  /**
   * Sets where the scene was found by other means. While it is tracked nothing changes, as tracking is more accurate.
   * What is known of the depths already is kept if the matches agree with it.
   * @param answer with Kind::SCENE, in the frames of the cameras of `k`. @param camera_in_odom as in add(), of the
   * image in which the scene was found.
   */
  void start(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /**
   * The next image.
   * @param image 8-bit, one channel. @param camera_in_odom pose of the camera at that time in a frame that does not
   * jump, empty where odometry does not know.
   * @return its `plane` is the virtual one: its normal is known, and its distance once odometry has told the unit.
   * @throws std::invalid_argument when the image has the wrong type.
   */
  const PlaneTrack& add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** What the last add() returned. */
  const PlaneTrack& track() const
  {
    return track_;
  }

  /**
   * Where the camera is by the last image. The covariance is what sightings, depths and the unit's length let one
   * expect; calibration and odometry are taken for exact. Empty unless the scene is tracked and the unit's length known.
   */
  std::optional<CameraPose> cameraPose() const;

  /** The corners of the stored view that are tracked [px]. */
  const std::vector<Eigen::Vector2d>& points() const;

  /** The depth of each of points() over that of the virtual plane; empty before start(). */
  std::vector<double> depths() const;

private:
  class Impl;

  std::unique_ptr<Impl> impl_;
  PlaneTrack track_;
};

}  // namespace view_servo
