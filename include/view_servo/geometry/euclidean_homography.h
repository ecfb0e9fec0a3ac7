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
  Eigen::Matrix3d rotation;                   ///< R
  Eigen::Vector3d translation_over_distance;  ///< t / d
  Eigen::Vector3d normal;                     ///< n

  /** R + (t / d) nᵀ: x_cur ~ H x_ref in normalised coordinates, with determinant d_cur / d. */
  Eigen::Matrix3d matrix() const
  {
    return rotation + translation_over_distance * normal.transpose();
  }
};

/** The rotation nearest to a matrix of rank two or three (orthogonal Procrustes, Golub & Van Loan). */
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& matrix);

/**
 * H in normalised coordinates, scaled to R + (t / d) nᵀ: its middle singular value is 1, and points seen lie in front.
 * @param h x_cur ~ H x_ref, 3x3, in pixels, any scale. @param k camera matrix of both images.
 * @param seen points of the reference image that lie on the plane [px]; not empty.
 */
Eigen::Matrix3d calibratedHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k, const Points& seen);

/**
 * The motion between two cameras that see a plane of known normal: what a homography does along the plane is the rotation
 * alone, however short the translation is.
 * @param calibrated of calibratedHomography(). @param normal unit vector in the reference camera's frame.
 */
EuclideanHomography motionBefore(const Eigen::Matrix3d& calibrated, const Eigen::Vector3d& normal);

/**
 * The homography after the current camera has moved on (thesis eq. 8.3).
 * @param motion X_next = motion X_cur [m]. @param distance d, of the plane from the reference camera [m]; infinity when it
 * is not known: then only the turn counts.
 */
EuclideanHomography movedOn(const EuclideanHomography& homography, const Eigen::Isometry3d& motion, double distance);

/**
 * The motions and planes that a homography can come from: of the two physical decompositions those before whose plane all
 * points lie, in both cameras. Two remain as a rule where the view does not change much; nothing in a single homography
 * tells which is true. Where the camera has only turned there is one, with a translation of zero and the normal NaN.
 * @param h x_cur ~ H x_ref, 3x3, in pixels, any scale. @param k camera matrix of both images.
 * @param seen points of the reference image that lie on the plane [px]; not empty.
 * @return none when no decomposition has all points in front of the cameras, as when H is no homography of a plane.
 */
std::vector<EuclideanHomography> decomposeHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k,
                                                     const Points& seen);

}  // namespace view_servo
