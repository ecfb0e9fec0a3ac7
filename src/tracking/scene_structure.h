// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/essential.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <vector>

namespace view_servo
{
/** @file
 * Where the points of a stored view are in space, and how cameras that see them have moved from it. All points are (x,
 * y) on z = 1 of their cameras' frames, a motion is X_cur = motion X_view, and lengths have a unit of the structure's
 * own.
 */

/** A point of the stored view. */
struct ScenePoint
{
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< in the stored view
  double inverse_depth = 1.0;                       ///< 1 / Z
  double information = 0.0;                         ///< inverse variance of inverse_depth
  double prior = 1.0;                               ///< inverse depth by the first search
  double prior_information = 0.0;                   ///< inverse variance of `prior`
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  ///< change of 1 / Z across the stored view, of the surface there

  /** q of the surface: q^T X = 1 for X on it. */
  Eigen::Vector3d surface() const
  {
    return { slope.x(), slope.y(), inverse_depth - slope.dot(point) };
  }
};

/** Where a camera sees a point. */
struct SceneSighting
{
  std::size_t index = 0;                                     ///< of the point
  Eigen::Vector2d seen = Eigen::Vector2d::Zero();            ///< in the current camera
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of `seen`
};

/** What one camera sees. */
struct SceneFrame
{
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  std::vector<SceneSighting> sightings;
};

/** Where a point is seen after a motion; NaN when it is not in front of the camera. */
Eigen::Vector2d projected(const ScenePoint& point, const Eigen::Isometry3d& motion);

/**
 * What a first search tells of the points: the inverse depths of the matches around each, scaled to a median of 1. They
 * are as uncertain as these differ and are far away. Where the motion is too short for depths all are 1, and very
 * uncertain.
 * @param points whose `point` is set; the rest is set here. @param matches that agree with the motion.
 * @return the motion, in the unit of the points.
 */
Eigen::Isometry3d beginStructure(const RelativePose& motion, const Correspondences& matches, double pixel,
                                 std::vector<ScenePoint>& points);

/**
 * The motion that explains the sightings best, from an estimate of it, by robust least squares. A point whose depth is
 * uncertain tells the less along its epipolar line.
 */
Eigen::Isometry3d fitMotion(const std::vector<ScenePoint>& points, const std::vector<SceneSighting>& sightings,
                            const Eigen::Isometry3d& initial);

/**
 * How exact a fitted motion is: covariance of a small rotation vector w, R' = exp(w) R, and of t, X_cur = R X_view + t, as
 * the sightings' residuals and what is known of the depths let one expect it. No more than 150 sightings count as
 * independent.
 */
Eigen::Matrix<double, 6, 6> motionCovariance(const std::vector<ScenePoint>& points,
                                             const std::vector<SceneSighting>& sightings,
                                             const Eigen::Isometry3d& motion);

/**
 * Whether a sighting is where a motion puts its point, to within `radius`, or lies so along the epipolar line as the
 * depth is uncertain. @param residual is set to the distance that remains then.
 */
bool supports(const ScenePoint& point, const SceneSighting& sighting, const Eigen::Isometry3d& motion, double radius,
              double& residual);

/** The inverse depth of a point after a sighting, the motion taken for exact. */
double withSighting(const ScenePoint& point, const SceneSighting& sighting, const Eigen::Isometry3d& motion);

/** Improves the points' depths and the frames' motions together, by robust least squares (bundle adjustment). */
void adjustStructure(std::vector<ScenePoint>& points, std::vector<SceneFrame>& frames);

/** Sets the slopes of all surfaces, each from the depths of the points around it that are about as far away. */
void findSlopes(std::vector<ScenePoint>& points, double pixel);

/**
 * The motion by matches without an estimate of it, in the unit of the points.
 * @return the number of points that agree with it; 0: none was found, and `motion` is unchanged.
 */
std::size_t locate(const std::vector<ScenePoint>& points, const Correspondences& matches, double pixel,
                   Eigen::Isometry3d& motion);

}  // namespace view_servo
