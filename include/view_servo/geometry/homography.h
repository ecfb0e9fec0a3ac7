// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <limits>
#include <optional>

namespace view_servo
{
/** @file
 * Plane homographies. Throughout, H maps the reference image to the current one: `x_cur ~ H x_ref`, 3x3, pixels.
 * Matrices that are estimated here have Frobenius norm 1 and the sign that gives points in view a positive third
 * coordinate.
 */

/**
 * H scaled so that H(2,2) = 1, or to Frobenius norm 1 where H(2,2) is nearly zero; other functions here return norm 1.
 * The sign stays: H(2,2) = -1 where the reference's first pixel, as a point of the plane, is behind the current camera.
 */
Eigen::Matrix3d normalizedHomography(const Eigen::Matrix3d& h);

/** The point H x, for x = `point` [px]. At or beyond the line at infinity (third coordinate <= 0) the result is NaN. */
Eigen::Vector2d transfer(const Eigen::Matrix3d& h, const Eigen::Vector2d& point);

/**
 * Squared symmetric transfer error [px^2]: |H x_ref - x_cur|^2 + |H^-1 x_cur - x_ref|^2 (Hartley & Zisserman 4.7).
 * Infinite where either point maps to or beyond infinity.
 */
double symmetricTransferError(const Eigen::Matrix3d& h, const Eigen::Matrix3d& h_inverse, const Correspondence& pair);

/**
 * Whether four correspondences can come from one plane seen from one side: in neither image are three of them nearly
 * collinear (height of each triangle at least `min_height` pixels), and all four triangles keep their orientation.
 */
bool isHomographySample(const Correspondences& four, double min_height = 2.0);

/**
 * Direct linear transform with isotropic normalisation (thesis eq. 2.19; Hartley 1997), n >= 4 points.
 * Empty when there are fewer than four, the system is rank deficient, or some point maps beyond infinity.
 */
std::optional<Eigen::Matrix3d> homographyFromPoints(const Correspondences& pairs);

/**
 * Minimises the summed symmetric transfer error by Levenberg-Marquardt from `initial`; with a finite `huber_width` [px]
 * each pair's error norm is Huber-weighted. Returns `initial` when it cannot be improved.
 */
Eigen::Matrix3d refineHomography(const Eigen::Matrix3d& initial, const Correspondences& pairs,
                                 double huber_width = std::numeric_limits<double>::infinity(), int max_iterations = 20);

}  // namespace view_servo
