// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/hand_eye.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Where a camera is mounted on a mobile base, without a calibration board: the camera looks at one plane, of which
 * neither the distance nor the direction is known, from several places on a floor. Straight ways tell the yaw, turns
 * tell roll, pitch, and the place on the base ahead and to the left. The height does not follow from motion on a floor.
 *
 * Types are those of hand_eye.h, with the base for the flange: HandEyePose::flange_in_base is the pose of the base in
 * the frame of odometry, with z up, and poses are in the order in which the base was there.
 */

/** How much motion a calibration needs, how good odometry is, and how certain the result has to be. */
struct MountParams
{
  int min_poses = 8;        ///< least number of poses that differ from one another, >= 6
  double min_turn = 0.35;   ///< least angle between two poses [rad]
  double min_way = 0.2;     ///< least distance between two poses that are turned alike, to 0.17 rad [m]
  double min_travel = 0.1;  ///< least way of the camera between two poses, as a part of the plane's distance
  /** Standard deviation of a way, along and across it, as a part of it: a first guess, the data tell it better. */
  double way_noise = 0.02;
  double turn_noise = 0.02;  ///< standard deviation of a turn, as a part of it: a first guess, as way_noise is
  double max_translation_sigma =
      0.005;  ///< largest standard deviation of the camera's place on the floor, any direction [m]
  double max_rotation_sigma = 0.0175;  ///< largest standard deviation of its orientation, about any axis [rad]
  /** Of the camera above the base's frame, where somebody has measured it [m]; NaN: unknown. */
  double height = std::numeric_limits<double>::quiet_NaN();
  double height_sigma = 0.005;  ///< standard deviation of `height` [m]
  /**
   * The plane is the floor, z = 0 in the frame of odometry: then the camera's height follows, and `height` does not
   * count.
   */
  bool sees_floor = false;
};

/** How far poses of a base are from one another. */
struct MountMotion
{
  int poses = 0;        ///< number of poses that are 1 cm or 2 degrees away from each one before them
  double turn = 0.0;    ///< largest angle between two poses [rad]
  double way = 0.0;     ///< largest distance between two poses that are turned alike [m]
  double travel = 0.0;  ///< largest way of the camera between two poses, as a part of the plane's distance
};

/** How well a pose fits the result. Not `used`, and all 0, when no calibration was computed. */
struct MountResidual
{
  bool used = false;    ///< false: the pose disagrees with the others, and was left out
  double pixels = 0.0;  ///< root mean square distance of the view's corners from where they should be [px]
  /** False: odometry since the last pose that is used disagrees with the images, and was left out. */
  bool odometry_used = true;
  /** Distance between the base's places by odometry and by the images, from the pose before that is used [m]. */
  double way = 0.0;
  /** Angle between the base's turns by odometry and by the images, from the pose before that is used [rad]. */
  double turn = 0.0;
};

/** What calibrateMount() finds. Unless `found`, only `message`, `missing`, `residuals` and `motion` have a meaning. */
struct MountResult
{
  bool found = false;
  std::string message;               ///< why nothing was found, in one line; empty when it was
  std::vector<std::string> missing;  ///< what is lacking, a line each, with what to do about it

  Eigen::Isometry3d camera_in_base =
      Eigen::Isometry3d::Identity();  ///< pose of the optical frame in the base's frame [m]
  /**
   * Covariance of `camera_in_base`: position [m], then rotation vector [rad], both along the base's axes, as in
   * HandEyeResult.
   */
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Isometry3d view_in_odom = Eigen::Isometry3d::Identity();  ///< camera pose that the view was stored at [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, of the plane in the view's camera frame, away from it
  double distance = 0.0;                              ///< of the plane from the view's camera [m]
  double distance_sigma = 0.0;                        ///< standard deviation of `distance` [m]
  double image_error = 0.0;  ///< standard deviation of a corner's coordinate, as the residuals have it [px]
  /** Standard deviation of a way by odometry, as a part of it, as the residuals have it. */
  double way_error = 0.0;
  /** Standard deviation of a turn by odometry, as a part of it, as the residuals have it. */
  double turn_error = 0.0;
  std::vector<MountResidual> residuals;  ///< one a pose
  MountMotion motion;                    ///< of the poses that were used

  /** Standard deviation of the camera's place on the floor along the least certain direction [m]. */
  double translationSigma() const;
  /** Standard deviation of the camera's rotation about the least certain axis [rad]. */
  double rotationSigma() const;
  /** Standard deviation of the camera's height [m]. */
  double heightSigma() const;
};

/**
 * How far poses of a base are from one another; `travel` is NaN when the homographies do not tell the plane, and other
 * numbers are of odometry alone. @throws std::invalid_argument as calibrateMount() does.
 */
MountMotion mountMotion(const HandEyeView& view, const std::vector<HandEyePose>& poses);

/** What is lacking in a motion, a line each, with what to do about it; empty when it suffices. */
std::vector<std::string> missingMotion(const MountMotion& motion, const MountParams& params);

/**
 * The pose of the camera on the base: in closed form from pairs of ways between poses (as Censi et al. 2013,
 * "Simultaneous calibration of odometry and sensor parameters for mobile robots", has it for motions of a sensor), then
 * by least squares over that, the view's pose, the plane, and where the base was at each pose, in the images and in
 * odometry from each pose to the next. How large the errors of images, ways and turns are is estimated with it
 * (variance components: Förstner 1979). Poses, and ways between poses, that contradict most others are left out.
 *
 * A part by which odometry has all ways too long is not seen: the camera's place comes out too far from the base's by
 * that part. Nothing is found when motion is lacking, when fewer than half of the poses or of the ways between them
 * agree, when the result is less certain than asked for, or when nothing tells the height.
 * @throws std::invalid_argument as calibrateHandEye() does.
 */
MountResult calibrateMount(const HandEyeView& view, const std::vector<HandEyePose>& poses,
                           const MountParams& params = {});

}  // namespace view_servo
