// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mount_problem.h"

#include <Eigen/Core>

#include <vector>

namespace view_servo::mount
{
/**
 * An estimate that suits most poses, from closed forms of pairs of legs. @param normal of the plane in the view's
 * camera frame.
 * @param estimate,used are set when there is one; `used` are the poses whose images agree on a motion along a floor.
 * @return whether there is one.
 */
bool robustStart(const Problem& problem, const std::vector<PlanarPose>& odometry, const MountParams& params,
                 const Eigen::Vector3d& normal, Estimate& estimate, Indices& used);

}  // namespace view_servo::mount
