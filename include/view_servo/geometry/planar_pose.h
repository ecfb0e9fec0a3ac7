// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace view_servo
{
/**
 * Pose on the floor of one frame in another, axes by REP 103 (x ahead, y to the left). "The pose of B in A", named
 * `b_in_a`, has the origin of B in the coordinates of A, and maps coordinates of B to those of A.
 */
struct PlanarPose
{
  double x = 0.0;    ///< [m], or in another unit where the scale is not known
  double y = 0.0;    ///< [m], or in the unit of x
  double yaw = 0.0;  ///< of B's x axis, counter-clockwise seen from above [rad], (-pi, pi]

  /** From A's origin to B's, in the unit of x and y. */
  double distance() const;
  /** Direction from A's origin to B's: 0 = straight ahead, positive to the left [rad], (-pi, pi]. */
  double heading() const;
};

/** The same angle in (-pi, pi] [rad]. */
double wrapAngle(double angle);

/** Pose of B in A and of C in B -> of C in A. */
PlanarPose compose(const PlanarPose& b_in_a, const PlanarPose& c_in_b);
/** Pose of B in A -> of A in B. */
PlanarPose inverse(const PlanarPose& b_in_a);
/** A pose in space projected onto the floor: x, y, and the yaw of its x axis. */
PlanarPose toPlanar(const Eigen::Isometry3d& pose);

/**
 * How a camera sits on a mobile base. Its level frame has the optical frame's origin and yaw, but is not tilted: x
 * points right, y straight down and z along the floor. Points (x, y) on the plane z = 1 of that frame are level points.
 */
struct CameraMount
{
  Eigen::Matrix3d level_from_camera = Eigen::Matrix3d::Identity();  ///< vectors: optical frame -> level frame
  PlanarPose on_base;  ///< pose of the camera in base_link [m, rad]; its x axis is the optical axis, seen from above

  CameraMount() = default;
  /**
   * @param base_from_camera pose of the optical frame in base_link.
   * @throws std::invalid_argument when the optical axis is more than 60 degrees out of the horizontal.
   */
  explicit CameraMount(const Eigen::Isometry3d& base_from_camera);

  /** Point on z = 1 of the optical frame -> level point; NaN when it is not in front of the level frame. */
  Eigen::Vector2d level(const Eigen::Vector2d& point) const;
  /** The inverse of level(). */
  Eigen::Vector2d unlevel(const Eigen::Vector2d& point) const;

  /**
   * The base's motion of a camera's motion: takes the pose of the camera at one place in the camera at another, and
   * returns the pose of the base at the one place in the base at the other.
   */
  PlanarPose ofBase(const PlanarPose& camera_in_camera) const;
  /** The inverse of ofBase(). */
  PlanarPose ofCamera(const PlanarPose& base_in_base) const;
};

}  // namespace view_servo
