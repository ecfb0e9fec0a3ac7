// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/still_pose.h"

#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/geometry/rotation_vector.h"

#include <Eigen/Core>

namespace view_servo
{
StillPose::StillPose(const StillPoseParams& params) : params_(params)
{
}

void StillPose::clear()
{
  samples_.clear();
}

std::optional<ArmSample> StillPose::add(const ArmSample& sample)
{
  if (!samples_.empty() &&
      (sample.stamp <= samples_.back().stamp || sample.stamp > samples_.back().stamp + params_.max_gap ||
       sample.seen.size() != samples_.back().seen.size()))
  {
    samples_.clear();
  }
  samples_.push_back(sample);
  while (samples_.size() > params_.min_samples && samples_[1].stamp <= sample.stamp - params_.duration)
  {
    samples_.pop_front();
  }
  if (samples_.size() < params_.min_samples || samples_.front().stamp > sample.stamp - params_.duration)
  {
    return std::nullopt;
  }

  const double part = 1.0 / static_cast<double>(samples_.size());
  ArmSample mean = sample;
  mean.seen.assign(sample.seen.size(), Eigen::Vector2d::Zero());
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  for (const ArmSample& one : samples_)
  {
    place += part * one.flange_in_base.translation();
    rotation += part * one.flange_in_base.linear();
    for (std::size_t i = 0; i < mean.seen.size(); ++i)
    {
      mean.seen[i] += part * one.seen[i];
    }
  }
  mean.flange_in_base.translation() = place;
  mean.flange_in_base.linear() = nearestRotation(rotation);
  for (const ArmSample& one : samples_)
  {
    const Eigen::Isometry3d off = mean.flange_in_base.inverse() * one.flange_in_base;
    bool still = off.translation().norm() <= params_.max_translation &&
                 rotationVector(off.linear()).norm() <= params_.max_rotation;
    for (std::size_t i = 0; i < mean.seen.size(); ++i)
    {
      still = still && (one.seen[i] - mean.seen[i]).norm() <= params_.max_pixels;
    }
    if (!still)
    {
      return std::nullopt;
    }
  }
  return mean;
}

}  // namespace view_servo
