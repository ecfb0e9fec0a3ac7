// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/hand_eye_collector.h"

#include "view_servo/geometry/camera_warp.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/geometry/rotation_vector.h"

#include <cmath>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo
{
HandEyeView handEyeViewOf(const StoredView& stored, const Camera& camera)
{
  const CameraWarp warp(cameraOf(stored, camera), camera.rectified());
  cv::Rect region = warp.region(stored.region);
  if (region.empty())
  {
    if (warp.active())
    {
      throw std::runtime_error("nothing of the view's region is in this camera's picture once distortion is removed");
    }
    region = cv::Rect(cv::Point(), stored.image.size());
  }
  HandEyeView view;
  view.k = warp.to().k;
  const auto corners = cornersOf(region);
  view.corners.assign(corners.begin(), corners.end());
  return view;
}

Eigen::Matrix3d homographyOf(const Homography& message)
{
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(message.h.data());
}

HandEyeCollector::HandEyeCollector(HandEyeView view) : view_(std::move(view))
{
}

void HandEyeCollector::clear()
{
  still_.clear();
  at_known_pose_ = false;
}

bool HandEyeCollector::add(double stamp, const Eigen::Matrix3d& h, const Eigen::Isometry3d& flange_in_base)
{
  ArmSample sample;
  sample.stamp = stamp;
  sample.flange_in_base = flange_in_base;
  for (const Eigen::Vector2d& corner : view_.corners)
  {
    const Eigen::Vector2d seen = transfer(h, corner);
    if (!seen.allFinite())
    {
      return false;
    }
    sample.seen.push_back(seen);
  }
  const std::optional<ArmSample> still = still_.add(sample);
  at_known_pose_ = false;
  if (!still)
  {
    return false;
  }
  Correspondences corners;
  for (std::size_t i = 0; i < view_.corners.size(); ++i)
  {
    corners.push_back({ view_.corners[i], still->seen[i] });
  }
  const std::optional<Eigen::Matrix3d> mean = homographyFromPoints(corners);
  if (!mean)
  {
    return false;
  }
  const HandEyePose pose{ still->flange_in_base, *mean };
  at_known_pose_ = true;
  if (!isNew(pose))
  {
    return false;
  }
  poses_.push_back(pose);
  return true;
}

/** Whether it is far enough from all that have been taken; poses beside each other tell little. */
bool HandEyeCollector::isNew(const HandEyePose& pose) const
{
  constexpr double FAR = 0.015;                  // [m]
  constexpr double TURNED = 3.0 * M_PI / 180.0;  // [rad]
  for (const HandEyePose& other : poses_)
  {
    const Eigen::Isometry3d way = other.flange_in_base.inverse() * pose.flange_in_base;
    if (way.translation().norm() < FAR && rotationVector(way.linear()).norm() < TURNED)
    {
      return false;
    }
  }
  return true;
}

}  // namespace view_servo
