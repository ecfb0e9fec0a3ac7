// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/types.hpp>

#include <optional>

namespace view_servo::sim
{
/**
 * The distance along a ray to the first surface that it meets [m]; empty when it meets none. Only surfaces without a
 * group count, and only distances above `nearest`.
 * @param origin in the world.
 * @param direction in the world, of unit length.
 */
std::optional<double> firstHit(const World& world, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               double nearest = 0.0);

/**
 * The part, in [0, 1], of what the camera sees from `reference` that it also sees from `current`: it must lie in the
 * image there, and nothing may hide it.
 * @param reference world from optical frame.
 * @param current world from optical frame.
 */
double shareInSight(const World& world, const Eigen::Isometry3d& reference, const Eigen::Isometry3d& current);

/**
 * The rectangle around what the world's region, as seen from its goal, is in an image from elsewhere [px], within that
 * image; empty when nothing of it is there. Of a world without a region, that is the whole image.
 * @param camera world from optical frame.
 */
cv::Rect regionSeenFrom(const World& world, const Eigen::Isometry3d& camera);

}  // namespace view_servo::sim
