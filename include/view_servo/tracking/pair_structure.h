// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/views/view_structure.h"

#include <opencv2/core/mat.hpp>

namespace view_servo
{
/**
 * Where the things are that a view shows, from one other image by the same camera and how the base moved between the
 * two.
 * @param view, other 8-bit, one channel. @param camera of both; without a fault. @param moved pose of the base at
 * `other` in the base at `view` [m, rad]. @return depths in metres; without points when too little is matched, or the
 * way between the two is too short for depths.
 */
ViewStructure structureOfPair(const cv::Mat& view, const cv::Mat& other, const Camera& camera, const CameraMount& mount,
                              const PlanarPose& moved);

}  // namespace view_servo
