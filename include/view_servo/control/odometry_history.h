// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"

#include <deque>
#include <optional>

namespace view_servo
{
/** Where the base was, by its odometry, over the last seconds. Times are those of the messages [s]. */
class OdometryHistory
{
public:
  /** @param duration poses older than the newest one by more than this are forgotten [s]. */
  explicit OdometryHistory(double duration) : duration_(duration)
  {
  }

  /**
   * Pose of the base in odometry's frame. One that comes late is sorted in, unless it is older than all that is kept.
   * @return whether it is the newest.
   */
  bool add(double stamp, const PlanarPose& pose);

  /**
   * The pose at a time, interpolated; up to `reach` [s] after the newest one it is extrapolated. Empty where nothing is
   * known.
   */
  std::optional<PlanarPose> at(double stamp, double reach = 0.2) const;

  /** The pose with the newest stamp; empty without any. */
  std::optional<PlanarPose> newest() const;

private:
  struct Entry
  {
    double stamp;
    PlanarPose pose;
  };

  double duration_;
  std::deque<Entry> entries_;  // oldest first
};

}  // namespace view_servo
