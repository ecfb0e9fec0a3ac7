// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Hand-eye calibration of a camera on an arm's flange, without a calibration board: the camera looks at one plane, of
 * which neither the distance nor the direction is known, from several poses of the arm.
 */

/** The stored view of the plane. */
struct HandEyeView
{
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();  ///< camera matrix of the view and of all images [px]
  Points corners;  ///< of the region that shows the plane [px]: four, no three of them on one line
};

/** What is known of one pose in which the arm stood still. */
struct HandEyePose
{
  Eigen::Isometry3d flange_in_base = Eigen::Isometry3d::Identity();  ///< by the arm's joints [m]
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();  ///< x_cur ~ H x_view of the plane, 3x3, any scale [px]
};

/** How much motion a calibration needs, and how certain its result has to be. */
struct HandEyeParams
{
  int min_poses = 8;                 ///< least number of poses that differ from one another, >= 6
  double min_rotation = 0.35;        ///< least angle between two poses about the main axis of all rotations [rad]
  double min_second_rotation = 0.2;  ///< least angle between two poses about an axis at right angles to that [rad]
  double min_travel = 0.15;          ///< least way of the camera between two poses, as a part of the plane's distance
  double max_translation_sigma = 0.005;  ///< largest standard deviation of the camera's place, in any direction [m]
  double max_rotation_sigma = 0.0175;    ///< largest standard deviation of its orientation, about any axis [rad]
  /** Whether the focal length is to be found, too: both focal lengths of HandEyeView::k are off by one factor. */
  bool finds_focal_length = false;
  double max_focal_sigma = 0.005;  ///< largest standard deviation of that factor, when it is to be found
  /**
   * Distance of the plane from the view's camera, along its normal, where somebody has measured it [m]; NaN: unknown.
   */
  double distance = std::numeric_limits<double>::quiet_NaN();
  /** Ratio of the arm's errors of position [m] to those of rotation [rad]; 0.5 suits arms that reach about 1 m. */
  double arm_lever = 0.5;
};

/** How far poses are from one another. */
struct HandEyeMotion
{
  int poses = 0;                 ///< number of poses that are 1 cm or 2 degrees away from each one before them
  double rotation = 0.0;         ///< largest angle between two poses about the main axis of all rotations [rad]
  double second_rotation = 0.0;  ///< largest angle about an axis at right angles to that [rad]
  double travel = 0.0;           ///< largest way of the camera between two poses, as a part of the plane's distance
};

/** How well a pose fits the result. Not `used`, and all 0, when no calibration was computed. */
struct HandEyeResidual
{
  bool used = false;         ///< false: the pose disagrees with the others, and was left out
  double pixels = 0.0;       ///< root mean square distance of the view's corners from where they should be [px]
  double translation = 0.0;  ///< distance between the camera's positions that the arm and the homography give [m]
  double rotation = 0.0;     ///< angle between the camera's orientations that these give [rad]
};

/**
 * What calibrateHandEye() finds. Unless `found`, only `message`, `missing`, `residuals` and `motion` have a meaning.
 */
struct HandEyeResult
{
  bool found = false;
  std::string message;               ///< why nothing was found, in one line; empty when it was
  std::vector<std::string> missing;  ///< motion that is lacking, a line each, with what to do about it

  Eigen::Isometry3d camera_in_flange = Eigen::Isometry3d::Identity();  ///< pose of the optical frame in the flange [m]
  /**
   * Covariance of `camera_in_flange`: position [m], then rotation vector [rad], both along the flange's axes, so that
   * the truth is (t + δt, exp(δr) R).
   */
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Isometry3d view_in_base = Eigen::Isometry3d::Identity();  ///< camera pose that the view was stored at [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, of the plane in the view's camera frame, away from it
  double distance = 0.0;                              ///< of the plane from the view's camera [m]
  double distance_sigma = 0.0;                        ///< standard deviation of `distance` [m]
  double focal_scale = 1.0;  ///< true focal lengths over those of HandEyeView::k; 1 unless it was to be found
  double focal_sigma = 0.0;  ///< standard deviation of `focal_scale`
  double image_error = 0.0;  ///< standard deviation of a corner's coordinate, as the residuals have it [px]
  /** Standard deviation of the arm's rotation about each axis, as the residuals have it [rad]. */
  double rotation_error = 0.0;
  /** Standard deviation of the flange's place along each axis, as the residuals have it [m]. */
  double translation_error = 0.0;
  std::vector<HandEyeResidual> residuals;  ///< one a pose
  HandEyeMotion motion;                    ///< of the poses that were used

  /** Standard deviation of the camera's place along the least certain direction [m]. */
  double translationSigma() const;
  /** Standard deviation of the camera's rotation about the least certain axis [rad]. */
  double rotationSigma() const;
};

/**
 * How far poses are from one another; `travel` is NaN when the homographies do not tell the plane, and other numbers
 * are of the arm alone. @throws std::invalid_argument as calibrateHandEye() does.
 */
HandEyeMotion handEyeMotion(const HandEyeView& view, const std::vector<HandEyePose>& poses);

/** What is lacking in a motion, a line each, with what to do about it; empty when it suffices. */
std::vector<std::string> missingMotion(const HandEyeMotion& motion, const HandEyeParams& params);

/**
 * The pose of the camera on the flange: from AX = XB by cv::calibrateHandEye (Horaud & Dornaika 1995) over triples of
 * poses, then refined together with the view's pose, and the plane's direction and distance, as errors of the view's
 * corners in the images. The errors of arm and image are told apart by restricted maximum likelihood, so that each
 * weighs as it should. Poses that contradict most others are left out. With `finds_focal_length` a factor of the focal
 * lengths is one more unknown, and residuals are those of the camera matrix with it.
 *
 * Nothing is found when motion is lacking, when fewer than half of the poses
 * agree, or when the result is less certain than asked for.
 * @throws std::invalid_argument when the view has not four corners in general position, the camera matrix is none, a
 * number is not finite, a flange's rotation is none or a known distance is not above 0.
 */
HandEyeResult calibrateHandEye(const HandEyeView& view, const std::vector<HandEyePose>& poses,
                               const HandEyeParams& params = {});

}  // namespace view_servo
