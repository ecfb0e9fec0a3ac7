// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/target_tracker.h"

namespace view_servo
{
TargetTracker::TargetTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
                             const PlaneTrackerParams& params, Target target)
  : target_(target),
    plane_(reference, region, k, params),
    scene_(target == Target::PLANE ? nullptr : std::make_unique<SceneTracker>(reference, region, k, params)),
    follows_scene_(target == Target::SCENE),
    decided_(target == Target::PLANE),
    next_(target == Target::SCENE ? Search::SCENE : Search::PLANE)
{
}

TargetTracker::Search TargetTracker::wanted() const
{
  if (track_.state != TrackingState::TRACKING)
  {
    return next_;
  }
  return target_ == Target::AUTO && !decided_ && !follows_scene_ ? Search::SCENE : Search::NONE;
}

void TargetTracker::addPlaneSearch(const std::optional<Eigen::Matrix3d>& h,
                                   const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  if (h && !follows_scene_)
  {
    plane_.start(*h, camera_in_odom);
  }
  if (!decided_)
  {
    next_ = Search::SCENE;  // should the plane not be there, or not be tracked
  }
}

void TargetTracker::addSceneSearch(const SceneFinder::Answer& answer,
                                   const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  if (target_ == Target::PLANE)
  {
    return;
  }
  const bool plane_is_tracked = !follows_scene_ && track_.state == TrackingState::TRACKING;
  if (answer.kind == SceneFinder::Kind::SCENE)
  {
    follows_scene_ = true;
    decided_ = true;
    next_ = Search::SCENE;
    scene_->start(answer, camera_in_odom);
    if (plane_is_tracked)
    {
      track_ = PlaneTrack();
    }
  }
  else if (plane_is_tracked)
  {
    decided_ = true;
  }
  else if (!decided_)
  {
    // Next time as a plane: with Target::SCENE only where that is what was seen.
    const bool as_plane = target_ == Target::AUTO || answer.kind == SceneFinder::Kind::PLANE;
    follows_scene_ = !as_plane;
    next_ = as_plane ? Search::PLANE : Search::SCENE;
  }
}

const PlaneTrack& TargetTracker::add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  track_ = follows_scene_ ? scene_->add(image, camera_in_odom) : plane_.add(image, camera_in_odom);
  return track_;
}

std::optional<CameraPose> TargetTracker::cameraPose() const
{
  if (track_.state != TrackingState::TRACKING)
  {
    return std::nullopt;
  }
  return follows_scene_ ? scene_->cameraPose() : plane_.cameraPose();
}

}  // namespace view_servo
