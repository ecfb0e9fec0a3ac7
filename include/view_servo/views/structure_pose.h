// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/camera_pose.h"
#include "view_servo/views/view_match.h"
#include "view_servo/views/view_store.h"
#include "view_servo/views/view_structure.h"

#include <cstddef>
#include <optional>

namespace view_servo
{
/** Where a camera is, by points of a stored view whose depths are known. */
struct StructurePose : CameraPose
{
  std::size_t inliers = 0;  ///< points of known depth that agree with it
};

/**
 * The pose of the camera that took the current image of a match, from what has been learnt of the view's depths:
 * inliers of the match that lie at points of the structure say where the camera is (cv::solvePnPRansac).
 * @param view with its calibration and pose, which tells how its camera was tilted: the z axis of ViewPose::frame is
 * up.
 * @param current calibration of the camera that took the current image, without a fault.
 * @return empty where the view has no calibration or pose, and where fewer than 12 points, or less than half of them,
 * agree.
 */
std::optional<StructurePose> structurePose(const ViewMatch& match, const StoredView& view,
                                           const ViewStructure& structure, const Camera& current);

}  // namespace view_servo
