// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mount_problem.h"

#include <string>
#include <vector>

namespace view_servo::mount
{
/** As mountMotion(). @param normal of the plane; NaN: the one on which most homographies agree. */
MountMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses, const Eigen::Vector3d& normal);

/** Why these are not the poses of a base on a floor; empty when they are. */
std::string offTheFloor(const std::vector<HandEyePose>& poses);

}  // namespace view_servo::mount
