// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/route_spacing.h"

#include <cmath>

namespace view_servo
{
std::vector<Parameter> parameters(RouteSpacingParams& params)
{
  return {
    real("distance", params.distance, "m", "[0.05, 5]", "distance from the last view at which the next one is stored"),
    real("turn", params.turn, "rad", "[0.02, 1]", "turn since the last view at which the next one is stored"),
    real("min_in_sight", params.min_in_sight, "", "[0, 1)",
         "the next view is stored, too, when a smaller share of the last one is in sight, by odometry, with things 2.5 "
         "m "
         "away"),
  };
}

RouteSpacing::RouteSpacing(const RouteSpacingParams& params, const cv::Mat& view, const Camera& camera,
                           const CameraMount& mount)
  : params_(params), mount_(mount), tracker_(view, camera, mount, ViewTrackerParams())
{
}

bool RouteSpacing::due(const PlanarPose& moved) const
{
  return moved.distance() >= params_.distance || std::abs(moved.yaw) >= params_.turn ||
         tracker_.shareInSight(mount_.ofCamera(inverse(moved))) < params_.min_in_sight;
}

}  // namespace view_servo
