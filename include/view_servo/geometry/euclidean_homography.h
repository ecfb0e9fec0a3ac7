// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <vector>

namespace view_servo
{
/**
 * A plane and the motion between two cameras that see it (thesis eq. 8.1): X_cur = R X_ref + t, and the plane is
 * nᵀ X_ref = d, d > 0, n a unit vector in the reference camera's frame. The distance d is not known.
 */
struct EuclideanHomography
{
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();               ///< R
  Eigen::Vector3d translation_over_distance = Eigen::Vector3d::Zero();  ///< t / d
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();                    ///< n

  /** R + (t / d) nᵀ: x_cur ~ H x_ref in normalised coordinates, with determinant d_cur / d. */
  Eigen::Matrix3d matrix() const
  {
    return rotation + translation_over_distance * normal.transpose();
  }
};

/** The rotation nearest to a matrix of rank two or three (orthogonal Procrustes, Golub & Van Loan). */
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& matrix);

/**
 * H in normalised coordinates, scaled to R + (t / d) nᵀ: the middle singular value is 1, and the sign is the one with
 * which most of `seen` lie in front of the current camera.
 * @param h x_cur ~ H x_ref, 3x3, in pixels, any scale. @param k camera matrix of both images.
 * @param seen points of the reference image that lie on the plane [px]; not empty.
 */
Eigen::Matrix3d calibratedHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k, const Points& seen);

/**
 * The motion between two cameras that see a plane of known normal. Directions within the plane are mapped by the
 * rotation alone, so that the result is well defined however short the translation is.
 * @param calibrated from calibratedHomography(). @param normal unit vector in the reference camera's frame.
 */
EuclideanHomography motionBefore(const Eigen::Matrix3d& calibrated, const Eigen::Vector3d& normal);

/**
 * The homography after the current camera has moved on (thesis eq. 8.3).
 * @param motion X_next = motion X_cur [m].
 * @param distance d, of the plane from the reference camera [m]; infinity when it is not known, and then only the
 * rotation of the motion is applied.
 */
EuclideanHomography movedOn(const EuclideanHomography& homography, const Eigen::Isometry3d& motion, double distance);

/**
 * The motions and planes that a homography can come from: those decompositions with all of `seen` in front of both
 * cameras. As a rule two remain when the view changes little, and a single homography does not tell which is true. When
 * the camera has only rotated there is one, with translation zero and a normal of NaN.
 * @param h x_cur ~ H x_ref, 3x3, in pixels, any scale. @param k camera matrix of both images.
 * @param seen points of the reference image that lie on the plane [px]; not empty.
 * @return empty when no decomposition has all points in front, as when H is not the homography of a plane.
 */
std::vector<EuclideanHomography> decomposeHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k,
                                                     const Points& seen);

}  // namespace view_servo
