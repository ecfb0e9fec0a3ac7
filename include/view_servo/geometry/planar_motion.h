// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/planar_pose.h"

#include <Eigen/Core>

#include <vector>

namespace view_servo
{
/** @file
 * Two views from cameras at one height above a floor (thesis 5.1). All points in images are level points: points (x, y)
 * on the plane z = 1 of a level frame, see CameraMount.
 */

/** R of X_cur = R X_ref + t, between level frames. @param yaw of the reference camera in the current one [rad]. */
Eigen::Matrix3d levelRotation(double yaw);
/** t of X_cur = R X_ref + t: position of the reference camera in the current one's level frame. */
Eigen::Vector3d levelTranslation(const PlanarPose& reference_in_current);

/**
 * E = [t]x R with x_curᵀ E x_ref = 0. As t is scaled to length 1, only the heading and yaw of the pose count. The zero
 * matrix when the distance is zero.
 */
Eigen::Matrix3d essentialMatrix(const PlanarPose& reference_in_current);

/**
 * The motions that agree with two correspondences (Choi & Kim 2018, "Fast and reliable minimal relative pose estimation
 * under planar motion"): up to four, each with both points in front of both cameras.
 * @return poses of the reference camera in the current one, with distance 1; none for points on the horizon.
 */
std::vector<PlanarPose> planarMotionFromTwoPoints(const Correspondence& first, const Correspondence& second);

/** What a correspondence and a motion say of the depth z of a point in the reference camera. */
struct InverseDepth
{
  double value = 0.0;        ///< 1 / z, z in the unit of the translation; negative: behind the reference camera
  double information = 0.0;  ///< squared derivative of the current level point by `value`; 0: depth unknown
};
/** Of a correspondence of level points, by the motion of level cameras. */
InverseDepth inverseDepth(const Correspondence& pair, const PlanarPose& reference_in_current);
/** The same for any motion X_cur = R X_ref + t. */
InverseDepth inverseDepth(const Correspondence& pair, const Eigen::Matrix3d& rotation,
                          const Eigen::Vector3d& translation);

/** A point of the reference view with its depth. */
struct Landmark
{
  Eigen::Vector2d reference = Eigen::Vector2d::Zero();  ///< level point
  double inverse_depth = 0.0;  ///< 1 / z in the reference camera, z in the unit of the poses used with it
};

/** The level point at which the current camera sees a landmark; NaN unless the landmark is in front of the camera. */
Eigen::Vector2d project(const Landmark& landmark, const PlanarPose& reference_in_current);

/** A landmark and where the current camera sees it. */
struct Sighting
{
  Landmark landmark;
  Eigen::Vector2d current = Eigen::Vector2d::Zero();  ///< level point
};

/**
 * Minimises the distances between the points seen and those expected, by Levenberg-Marquardt from `initial`, with
 * Tukey's biweight (Beaton & Tukey 1974): the larger a residual the less it counts, and beyond 3 `width` not at all.
 * @param width in units of the level points.
 * @return pose of the reference camera in the current one; `initial` when the sightings do not determine it.
 */
PlanarPose refinePlanarPose(const PlanarPose& initial, const std::vector<Sighting>& sightings, double width);

/**
 * Minimises the summed squared Sampson distance of the correspondences over heading and yaw, by Levenberg-Marquardt
 * from `initial`.
 * @return pose of the reference camera in the current one, with distance 1.
 */
PlanarPose refinePlanarMotion(const PlanarPose& initial, const Correspondences& pairs, int max_iterations = 10);

}  // namespace view_servo
