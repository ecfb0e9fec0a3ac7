// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_tracker.h"

#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/parameters/faults.h"

#include <Eigen/LU>

#include <limits>

namespace view_servo
{
std::vector<Parameter> parameters(PlaneTrackerParams& params)
{
  return joined({ parameters(params.aligner),
                  parameters(params.filter),
                  {
                      integer("lost_after", params.lost_after, "", ">= 1",
                              "images in a row without the plane after which it is lost"),
                  } });
}

std::vector<std::string> PlaneTrackerParams::validate() const
{
  return faultsOf(*this);
}

PlaneTracker::PlaneTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
                           const PlaneTrackerParams& params)
  : params_(params), k_(k), aligner_(reference, region, params.aligner), filter_(params.filter)
{
  requireNoFaults("parameters of the plane tracker", params.validate());
}

void PlaneTracker::start(const Eigen::Matrix3d& h, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  if (track_.state != TrackingState::TRACKING)
  {
    last_ = Place{ h, camera_in_odom };
  }
}

Eigen::Matrix3d PlaneTracker::predict(const std::optional<Eigen::Isometry3d>& camera_in_odom) const
{
  if (!camera_in_odom || !last_->camera_in_odom)
  {
    return last_->h;
  }
  const Eigen::Matrix3d calibrated = calibratedHomography(last_->h, k_, points());
  const std::optional<PlaneEstimate> plane = filter_.estimate();
  const Eigen::Vector3d normal = plane ? plane->motion.normal : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
  const double distance = plane && plane->distance ? *plane->distance : std::numeric_limits<double>::infinity();
  const Eigen::Isometry3d moved = camera_in_odom->inverse() * *last_->camera_in_odom;
  const Eigen::Matrix3d now = movedOn(motionBefore(calibrated, normal), moved, distance).matrix();
  return k_ * now * k_.inverse();
}

const PlaneTrack& PlaneTracker::add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  track_ = PlaneTrack();
  if (!last_)
  {
    return track_;
  }
  track_.homography = aligner_.track(image, predict(camera_in_odom));
  if (!track_.homography.found)
  {
    // Odometry may be wrong.
    track_.homography = aligner_.track(image, last_->h);
  }
  if (!track_.homography.found)
  {
    ++missed_;
    track_.state = found_once_ && missed_ >= params_.lost_after ? TrackingState::LOST : TrackingState::SEARCHING;
    return track_;
  }
  missed_ = 0;
  found_once_ = true;
  last_ = Place{ track_.homography.h, camera_in_odom };
  filter_.add(camera_in_odom, track_.homography.h, k_, points());
  track_.state = TrackingState::TRACKING;
  track_.plane = filter_.estimate();
  return track_;
}

std::optional<CameraPose> PlaneTracker::cameraPose() const
{
  if (track_.state != TrackingState::TRACKING)
  {
    return std::nullopt;
  }
  return filter_.cameraPose(k_, track_.homography.points, track_.homography.rms);
}

}  // namespace view_servo
