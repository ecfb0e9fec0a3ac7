// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/tracking/view_tracker.h"

#include <opencv2/core/mat.hpp>

#include <vector>

namespace view_servo
{
/** When a route needs its next view. */
struct RouteSpacingParams
{
  double distance = 0.5;      ///< the next view is due at this distance from the last one [m]
  double turn = 0.2618;       ///< it is due after this turn since the last one [rad]
  double min_in_sight = 0.6;  ///< it is due when a smaller share of the last one is in sight, [0, 1)
};

/** Names, units and ranges of these parameters. */
std::vector<Parameter> parameters(RouteSpacingParams& params);

/** Says when a base has left the last view of a route far enough behind for the next one. */
class RouteSpacing
{
public:
  /** @param view the last view's image; 8-bit, one channel. @param camera that took it; without a fault. */
  RouteSpacing(const RouteSpacingParams& params, const cv::Mat& view, const Camera& camera, const CameraMount& mount);

  /**
   * Whether the next view is due, by distance, turn, or the share of the last view in sight, which is by odometry, with
   * things as far away as a ViewTracker assumes where it knows no depths.
   * @param moved pose of the base in where it was when the last view was taken [m, rad].
   */
  bool due(const PlanarPose& moved) const;

private:
  RouteSpacingParams params_;
  CameraMount mount_;
  ViewTracker tracker_;
};

}  // namespace view_servo
