// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/plane_session.h"

#include "view_servo/geometry/homography.h"
#include "view_servo/ros/node_base.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <utility>

namespace view_servo
{
PlaneSession::PlaneSession(std::shared_ptr<const PreparedImage> view, const sensor_msgs::CameraInfo& info,
                           const PlaneTrackerParams& params)
  : params_(params),
    view_(std::move(view)),
    rectifier_(info),
    reference_(rectifier_.image(view_->grey())),
    region_(rectifier_.region(view_->region()))
{
  if (region_.empty())
  {
    throw std::runtime_error("the view's region is not in the image without the camera's distortion");
  }
  reset();
}

void PlaneSession::reset()
{
  tracker_ = std::make_unique<PlaneTracker>(reference_, region_, rectifier_.k(), params_);
  last_h_.reset();
  path_.clear();
}

bool PlaneSession::checkCalibration(const sensor_msgs::CameraInfo& info)
{
  calibration_changed_ = calibration_changed_ || !rectifier_.hasCalibration(info);
  return !calibration_changed_;
}

std::string PlaneSession::checkTime(const ros::Time& stamp)
{
  std::string jump = timeJump(last_stamp_, stamp, "images");
  if (!jump.empty())
  {
    reset();
  }
  return jump;
}

PlaneFinder::Question PlaneSession::question(const cv::Mat& raw) const
{
  return { view_, raw, last_h_ };
}

void PlaneSession::start(const PlaneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  std::optional<Eigen::Matrix3d> h = answer.h;
  if (h && rectifier_.active())
  {
    Correspondences pairs;
    for (const Correspondence& pair : answer.inliers)
    {
      pairs.push_back({ rectifier_.point(pair.reference), rectifier_.point(pair.current) });
    }
    h = homographyFromPoints(pairs);
  }
  if (h)
  {
    tracker_->start(*h, camera_in_odom);
  }
}

const PlaneTrack& PlaneSession::add(const cv::Mat& raw, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  constexpr std::size_t LONGEST_PATH = 300;
  last_image_ = rectifier_.image(raw);
  const PlaneTrack& track = tracker_->add(last_image_, camera_in_odom);
  if (track.state == TrackingState::TRACKING)
  {
    last_h_ = track.homography.h;
    const Eigen::Vector2d middle(region_.x + 0.5 * (region_.width - 1), region_.y + 0.5 * (region_.height - 1));
    path_.push_back(transfer(*last_h_, middle));
    if (path_.size() > LONGEST_PATH)
    {
      path_.erase(path_.begin());
    }
  }
  return track;
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
