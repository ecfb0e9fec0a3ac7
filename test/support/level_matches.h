// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/robust/random.h"

#include <Eigen/Core>

#include <cmath>

namespace view_servo
{
namespace test
{
/** @file What level cameras of 640x480 pixels see of points, on the plane z = 1, made by nothing that is tested. */

constexpr double FOCAL_LENGTH = 520.0;  // [px]

/** Where a camera's image ends on the plane z = 1: at x = -HALF_WIDTH and HALF_WIDTH, and alike in y. */
constexpr double HALF_WIDTH = 0.615;
constexpr double HALF_HEIGHT = 0.46;

inline bool inImage(const Eigen::Vector2d& point)
{
  return std::abs(point.x()) < HALF_WIDTH && std::abs(point.y()) < HALF_HEIGHT;
}

/** Anywhere in the image. */
inline Eigen::Vector2d randomPosition(Rng& rng)
{
  const double x = uniform(rng, -HALF_WIDTH, HALF_WIDTH);
  return { x, uniform(rng, -HALF_HEIGHT, HALF_HEIGHT) };
}

/** Standard deviation of a coordinate of noisy(): half a pixel. */
constexpr double POSITION_NOISE = 0.5 / FOCAL_LENGTH;

inline Eigen::Vector2d noisy(const Eigen::Vector2d& position, Rng& rng)
{
  const double x = position.x() + POSITION_NOISE * gaussian(rng);
  return { x, position.y() + POSITION_NOISE * gaussian(rng) };
}

/** A point of the reference camera's optical frame in that of the current camera [m]. */
inline Eigen::Vector3d inCurrentCamera(const Eigen::Vector3d& p, const PlanarPose& reference_in_current)
{
  const double c = std::cos(reference_in_current.yaw);
  const double s = std::sin(reference_in_current.yaw);
  // x right, z ahead; the pose's y is to the left.
  return { c * p.x() - s * p.z() - reference_in_current.y, p.y(), s * p.x() + c * p.z() + reference_in_current.x };
}

}  // namespace test
}  // namespace view_servo
