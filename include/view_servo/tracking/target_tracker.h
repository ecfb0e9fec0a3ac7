// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/scene_finder.h"
#include "view_servo/tracking/scene_tracker.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <memory>
#include <optional>
#include <vector>

namespace view_servo
{
/** What a stored view is taken to show. */
enum class Target
{
  PLANE,  ///< one plane
  SCENE,  ///< things at different depths
  AUTO    ///< what the images tell
};

/**
 * Follows a stored view by a PlaneTracker or a SceneTracker, whichever fits what it shows. It does not search itself:
 * it says what is to be searched for next, and takes the answers.
 *
 * With Target::AUTO a plane is searched for first, and followed as with Target::PLANE. Once it is followed, one search
 * for a scene finds out whether the view has depth; where it does, the scene is followed from then on. Where no plane
 * is found, a scene is searched for.
 *
 * With Target::SCENE a view that shows one plane from everywhere is followed as one.
 */
class TargetTracker
{
public:
  enum class Search
  {
    NONE,
    PLANE,  ///< by PlaneFinder
    SCENE   ///< by SceneFinder
  };

  /** Arguments and errors are those of PlaneTracker. */
  TargetTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
                const PlaneTrackerParams& params, Target target);

  /** Which search should begin in the image of the last add(). */
  Search wanted() const;

  /**
   * The end of a search for a plane. @param h where it is, x_cur ~ H x_ref [px]; empty: not found. @param
   * camera_in_odom as in add(), of the image that was searched.
   */
  void addPlaneSearch(const std::optional<Eigen::Matrix3d>& h, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** The end of a search for a scene. @param answer in the frames of the cameras of `k`. */
  void addSceneSearch(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** The next image. Arguments and errors are those of PlaneTracker::add(). */
  const PlaneTrack& add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom);

  /** What the last add() returned. */
  const PlaneTrack& track() const
  {
    return track_;
  }

  /** Where the camera is by the last image, see PlaneFilter::cameraPose() and SceneTracker::cameraPose(). */
  std::optional<CameraPose> cameraPose() const;

  /** Whether the scene is what is followed. */
  bool followsScene() const
  {
    return follows_scene_;
  }

  /** The corners of the stored view that are tracked [px]. */
  const std::vector<Eigen::Vector2d>& points() const
  {
    return follows_scene_ ? scene_->points() : plane_.points();
  }

private:
  Target target_;
  PlaneTracker plane_;
  std::unique_ptr<SceneTracker> scene_;  // null with Target::PLANE
  bool follows_scene_;
  bool decided_;  // whether that is for good
  Search next_;   // while nothing is tracked
  PlaneTrack track_;
};

}  // namespace view_servo
