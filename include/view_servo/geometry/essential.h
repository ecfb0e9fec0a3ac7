// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <vector>

namespace view_servo
{
/** @file
 * Essential matrices: fundamental matrices of points (x, y) on the plane z = 1 of their cameras' frames.
 */

/** Motion between two calibrated cameras: X_cur = R X_ref + t, the length of t unknown. */
struct RelativePose
{
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::UnitZ();  ///< of length 1

  /** x_curᵀ E x_ref = 0, E = [t]x R. */
  Eigen::Matrix3d essential() const;
};

/** [v]x: the matrix whose product with w is v × w. */
Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v);

/**
 * The essential matrices of exactly five correspondences, ten at most (Nistér 2004); none for another number of them.
 */
std::vector<Eigen::Matrix3d> essentialFromFivePoints(const Correspondences& five);

/** The four motions that give an essential matrix; with at most one of them, points lie in front of both cameras. */
std::vector<RelativePose> posesFromEssential(const Eigen::Matrix3d& essential);

/**
 * Minimises the summed squared Sampson distance over the five parameters of the motion by Levenberg-Marquardt from
 * `initial`, which is returned when it cannot be improved.
 */
RelativePose refineRelativePose(const RelativePose& initial, const Correspondences& pairs, int max_iterations = 10);

/**
 * Covariance of a motion that was fitted to pairs, to first order: of a small rotation vector [rad] applied before R,
 * so about the axes of the reference camera, and of the unit vector t, which does not vary along itself.
 * @param variance of a Sampson distance, in units of the points. @return not finite where the pairs leave the motion
 * open.
 */
Eigen::Matrix<double, 6, 6> covarianceOf(const RelativePose& pose, const Correspondences& pairs, double variance);

}  // namespace view_servo
