// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/plane_session.h"

#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/ros/conversions.h"

#include <Eigen/LU>

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <utility>

namespace view_servo
{
PlaneSession::PlaneSession(const CachedView& view, const sensor_msgs::CameraInfo& info,
                           const PlaneTrackerParams& params, Target target)
  : params_(params),
    target_(target),
    view_camera_(cameraOf(view.stored, toCamera(info))),
    camera_(toCamera(info)),
    view_(view.image),
    info_(info),
    rectification_(camera_, camera_.rectified()),
    view_warp_(view_camera_, rectification_.to()),
    reference_(view_warp_.image(view_->grey())),
    region_(view_warp_.region(view_->region()))
{
  if (region_.empty())
  {
    throw std::runtime_error("nothing of the view's region is in this camera's picture once distortion is removed");
  }
  reset();
}

void PlaneSession::reset()
{
  tracker_ = std::make_unique<TargetTracker>(reference_, region_, rectification_.to().k, params_, target_);
  last_h_.reset();
  path_.clear();
}

bool PlaneSession::checkCalibration(const sensor_msgs::CameraInfo& info)
{
  calibration_changed_ = calibration_changed_ || !sameCalibration(info_, info);
  return !calibration_changed_;
}

StampOrder::Place PlaneSession::checkTime(const ros::Time& stamp)
{
  const StampOrder::Place place = order_.check(stamp);
  if (place == StampOrder::GONE_BACK)
  {
    reset();
  }
  return place;
}

PlaneFinder::Question PlaneSession::question(const cv::Mat& raw) const
{
  std::optional<Eigen::Matrix3d> last_h = last_h_;
  if (last_h)
  {
    last_h = rectification_.homography().inverse() * *last_h * view_warp_.homography();
  }
  return { view_, raw, last_h };
}

SceneFinder::Question PlaneSession::sceneQuestion(const cv::Mat& raw)
{
  if (!scene_view_)
  {
    scene_view_ = std::make_shared<const PreparedImage>(view_->grey(), view_->region(), SceneFinder().features());
  }
  return { scene_view_, view_camera_, raw, camera_ };
}

void PlaneSession::start(const PlaneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  std::optional<Eigen::Matrix3d> h = answer.h;
  if (h && (rectification_.active() || view_warp_.active()))
  {
    Correspondences pairs;
    for (const Correspondence& pair : answer.inliers)
    {
      const Correspondence moved{ view_warp_.point(pair.reference), rectification_.point(pair.current) };
      if (moved.reference.allFinite() && moved.current.allFinite())
      {
        pairs.push_back(moved);
      }
    }
    h = homographyFromPoints(pairs);
  }
  tracker_->addPlaneSearch(h, camera_in_odom);
}

void PlaneSession::start(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  tracker_->addSceneSearch(answer, camera_in_odom);
}

const PlaneTrack& PlaneSession::add(const cv::Mat& raw, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  constexpr std::size_t LONGEST_PATH = 300;
  last_image_ = rectification_.image(raw);
  const PlaneTrack& track = tracker_->add(last_image_, camera_in_odom);
  if (track.state == TrackingState::TRACKING)
  {
    last_h_ = track.homography.h;
    path_.push_back(transfer(*last_h_, middleOf(region_)));
    if (path_.size() > LONGEST_PATH)
    {
      path_.erase(path_.begin());
    }
  }
  return track;
}

PlaneScene PlaneSession::scene() const
{
  PlaneScene scene;
  scene.camera = rectification_.to();
  scene.region = region_;
  scene.track = tracker_->track();
  scene.points = tracker_->points();
  return scene;
}

cv::Mat PlaneSession::overlay(const std::string& text) const
{
  const TrackedHomography& homography = tracker_->track().homography;
  FollowedView view;
  view.region = region_;
  view.h = homography.h;
  view.found = homography.points;
  view.path = path_;
  view.text = text;
  for (const Eigen::Vector2d& point : tracker_->points())
  {
    if (std::find(view.found.begin(), view.found.end(), point) == view.found.end())
    {
      view.missing.push_back(point);
    }
  }
  return drawFollowedView(last_image_, view);
}

}  // namespace view_servo
