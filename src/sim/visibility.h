// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>

namespace view_servo::sim
{
/**
 * Distance along a ray to the first surface without a group [m], beyond `nearest`; empty: it meets none.
 * @param direction of unit length.
 */
std::optional<double> firstHit(const World& world, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               double nearest = 0.0);

/**
 * Part of what a camera sees from `reference` that it also sees from `current`, in the image and not hidden, [0, 1].
 * Both: world from optical frame.
 */
double shareInSight(const World& world, const Eigen::Isometry3d& reference, const Eigen::Isometry3d& current);

}  // namespace view_servo::sim
