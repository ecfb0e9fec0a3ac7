// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <limits>
#include <optional>
#include <vector>

namespace view_servo
{
/** @file
 * Fundamental matrices. Throughout, `x_curᵀ F x_ref = 0`: F x_ref is the epipolar line in the current image, 3x3,
 * pixels, rank 2. Matrices returned here have Frobenius norm 1.
 */

/** Squared Sampson distance [px^2] (thesis eq. 9.2; first-order approximation of the squared reprojection error). */
double sampsonError(const Eigen::Matrix3d& f, const Correspondence& pair);

/**
 * The one or three fundamental matrices of exactly seven correspondences (thesis eq. 2.14): real roots of the cubic
 * det(a F1 + (1 - a) F2) = 0. Empty when the seven do not determine a pencil (rank below 7).
 */
std::vector<Eigen::Matrix3d> fundamentalFromSevenPoints(const Correspondences& seven);

/**
 * Normalised 8-point algorithm (Hartley 1997), n >= 8, rank 2 enforced. Empty when there are fewer or when the
 * points do not determine F (all on one plane, or collinear).
 */
std::optional<Eigen::Matrix3d> fundamentalFromPoints(const Correspondences& pairs);

/**
 * Minimises the summed squared Sampson distance (thesis eq. 2.15) over the seven parameters of a rank-2 matrix
 * (orthonormal representation, Bartoli & Sturm 2004) by Levenberg-Marquardt from `initial`; with a finite
 * `huber_width` [px] each distance is Huber-weighted. Returns `initial` when it cannot be improved.
 */
Eigen::Matrix3d refineFundamental(const Eigen::Matrix3d& initial, const Correspondences& pairs,
                                  double huber_width = std::numeric_limits<double>::infinity(),
                                  int max_iterations = 20);

/** Epipole in the current image (left null vector of F, homogeneous, unit norm). */
Eigen::Vector3d currentEpipole(const Eigen::Matrix3d& f);

/** Epipole in the reference image (right null vector of F, homogeneous, unit norm). */
Eigen::Vector3d referenceEpipole(const Eigen::Matrix3d& f);

/** Pixel of a homogeneous epipole; NaN when it lies farther than 10^6 px off, which is as good as at infinity. */
Eigen::Vector2d epipolePixel(const Eigen::Vector3d& epipole);

}  // namespace view_servo
