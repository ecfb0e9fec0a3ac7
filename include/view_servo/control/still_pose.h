// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Geometry>

#include <cstddef>
#include <deque>
#include <optional>

namespace view_servo
{
/** When an arm counts as standing still. */
struct StillPoseParams
{
  double duration = 0.8;          ///< how long it has to stand [s]
  std::size_t min_samples = 5;    ///< least number of samples within `duration`
  double max_gap = 0.5;           ///< longest time between two samples [s]
  double max_translation = 1e-3;  ///< largest distance of the flange from its mean place [m]
  double max_rotation = 2e-3;     ///< largest angle between the flange and its mean orientation [rad]
  double max_pixels = 0.5;        ///< largest distance of a point in the image from its mean place [px]
};

/** Where an arm and what its camera sees are at one moment. */
struct ArmSample
{
  double stamp = 0.0;                                                ///< of the image [s]
  Eigen::Isometry3d flange_in_base = Eigen::Isometry3d::Identity();  ///< pose of the flange at that time [m]
  Points seen;  ///< where some points of a plane are in the image [px], in the same order in each sample
};

/** Waits until both an arm and what its camera sees stand still, and averages over that time. */
class StillPose
{
public:
  explicit StillPose(const StillPoseParams& params = {});

  /**
   * The next sample. It begins anew when it is not newer than the last, is more than max_gap newer, or has another
   * number of points.
   * @return the mean of the last samples, with the newest stamp, while they stand still; else empty.
   */
  std::optional<ArmSample> add(const ArmSample& sample);

  /** Forgets all samples, as when the image does not show the points. */
  void clear();

private:
  StillPoseParams params_;
  std::deque<ArmSample> samples_;
};

}  // namespace view_servo
