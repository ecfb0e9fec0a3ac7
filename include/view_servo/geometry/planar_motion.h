// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <limits>
#include <vector>

namespace view_servo
{
/** @file
 * Two views from one floor (thesis 5.1). Positions in images are here those of a level camera: points (x, y) on the
 * plane z = 1 of a frame whose x axis points right, y straight down and z along the floor. CameraMount makes such points
 * of a tilted camera's.
 */

/**
 * Where one thing on the floor is as seen from another, axes by REP 103: `a.x` ahead, `a.y` to the left, turned by
 * `a.yaw` counter-clockwise seen from above. "The pose of B in A" maps coordinates of B to those of A.
 */
struct PlanarPose
{
  double x = 0.0;    ///< [m], or in another unit where the scale is not known
  double y = 0.0;    ///< likewise
  double yaw = 0.0;  ///< [rad], (-pi, pi]

  double distance() const;
  /** Direction to it: 0 = straight ahead, positive left [rad], (-pi, pi]. */
  double heading() const;
};

/** The angle in (-pi, pi] [rad]. */
double wrapAngle(double angle);

/** Pose of B in A and of C in B -> of C in A. */
PlanarPose compose(const PlanarPose& b_in_a, const PlanarPose& c_in_b);
/** Pose of B in A -> of A in B. */
PlanarPose inverse(const PlanarPose& b_in_a);
/** Its part on the floor: x, y, and the yaw of its x axis. */
PlanarPose toPlanar(const Eigen::Isometry3d& pose);

/** How a camera sits on a base. */
struct CameraMount
{
  Eigen::Matrix3d level_from_camera = Eigen::Matrix3d::Identity();  ///< optical frame -> level frame of the same yaw
  PlanarPose on_base;  ///< pose of the level camera in base_link, its x axis along the optical axis

  CameraMount() = default;
  /**
   * @param base_from_camera pose of the optical frame in base_link.
   * @throws std::invalid_argument when the optical axis is more than 60 degrees out of the horizontal.
   */
  explicit CameraMount(const Eigen::Isometry3d& base_from_camera);

  /** Point on z = 1 of the optical frame -> of the level frame; NaN when it is not in front of that. */
  Eigen::Vector2d level(const Eigen::Vector2d& point) const;
  /** The other way round. */
  Eigen::Vector2d unlevel(const Eigen::Vector2d& point) const;

  /** Pose of one camera in another -> of the one base in the other. */
  PlanarPose ofBase(const PlanarPose& camera_in_camera) const;
  /** The other way round. */
  PlanarPose ofCamera(const PlanarPose& base_in_base) const;
};

/** Rotation of vectors of the reference camera into the current one's level frame; `yaw` is that of the reference. */
Eigen::Matrix3d levelRotation(double yaw);
/** Position of the reference camera in the current one's level frame: X_cur = R X_ref + t. */
Eigen::Vector3d levelTranslation(const PlanarPose& reference_in_current);

/**
 * E with x_curᵀ E x_ref = 0, |t| = 1, for the pose of the reference camera in the current one; only heading and yaw
 * count. Zero when the distance is.
 */
Eigen::Matrix3d essentialMatrix(const PlanarPose& reference_in_current);

/**
 * The motions that two correspondences allow (Choi & Kim 2018, "Fast and reliable minimal relative pose estimation under
 * planar motion"): up to four yaws, of each the sense of the translation for which both points are in front of both
 * cameras. Poses of the reference camera in the current one, with distance 1. Empty for points on the horizon.
 */
std::vector<PlanarPose> planarMotionFromTwoPoints(const Correspondence& first, const Correspondence& second);

/** What a correspondence says of a point's depth. */
struct InverseDepth
{
  double value = 0.0;        ///< 1 / z in the reference camera, in units of 1 / that of the pose; negative: behind it
  double information = 0.0;  ///< squared motion of the current point for a unit of `value`; 0: nothing is known
};
InverseDepth inverseDepth(const Correspondence& pair, const PlanarPose& reference_in_current);
/** The same of any motion X_cur = R X_ref + t. */
InverseDepth inverseDepth(const Correspondence& pair, const Eigen::Matrix3d& rotation,
                          const Eigen::Vector3d& translation);

/** A point of the reference view with its depth. */
struct Landmark
{
  Eigen::Vector2d reference;  ///< level point
  double inverse_depth;       ///< 1 / z in the reference camera
};

/** Where the current camera sees a landmark: level point; NaN when it is not in front of it. */
Eigen::Vector2d project(const Landmark& landmark, const PlanarPose& reference_in_current);

/** A landmark and where it is seen. */
struct Sighting
{
  Landmark landmark;
  Eigen::Vector2d current;  ///< level point
};

/**
 * The pose of the reference camera in the current one that explains the sightings best, by Gauss-Newton from `initial`;
 * residuals beyond `width` (in units of the points) count less and less, beyond thrice of it not at all (Tukey 1960).
 * Returns `initial` when they do not determine it.
 */
PlanarPose refinePlanarPose(const PlanarPose& initial, const std::vector<Sighting>& sightings, double width);

/**
 * Motion of unit distance that minimises the summed squared Sampson distance of the correspondences over heading and
 * yaw, by Levenberg-Marquardt from `initial`.
 */
PlanarPose refinePlanarMotion(const PlanarPose& initial, const Correspondences& pairs, int max_iterations = 10);

}  // namespace view_servo
