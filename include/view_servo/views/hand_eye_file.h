// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/hand_eye.h"

#include <Eigen/Geometry>

#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
/** A hand-eye calibration with the names of its frames, as a file holds it. */
struct HandEyeFile
{
  std::string base_frame;    ///< tf frame of the arm's base
  std::string flange_frame;  ///< tf frame of the flange that carries the camera
  std::string camera_frame;  ///< the camera's optical frame
  Eigen::Isometry3d camera_in_flange = Eigen::Isometry3d::Identity();  ///< optical frame's pose [m]
  std::vector<double> covariance;  ///< row-major 6x6, as HandEyeResult has it [m, rad]; may be empty
  std::string comment;             ///< one line; is written, not read
};

/**
 * Reads a file as this package or easy_handeye writes it: `parameters` with eye_on_hand, robot_base_frame,
 * robot_effector_frame and tracking_base_frame, and `transformation` with x, y, z, qx, qy, qz, qw.
 * @throws std::runtime_error naming the file and what is wrong with it; also when the camera is not on the hand.
 */
HandEyeFile readHandEyeFile(const std::string& path);

/** Writes such a file in one step. @throws std::runtime_error naming the file when it cannot be written. */
void writeHandEyeFile(const HandEyeFile& hand_eye, const std::string& path);

/** What a calibration is computed from, as a file holds it. */
struct HandEyePosesFile
{
  std::string base_frame;    ///< tf frame of the arm's base
  std::string flange_frame;  ///< tf frame of the flange that carries the camera
  std::string camera_frame;  ///< the camera's optical frame
  std::string view_name;     ///< name of the stored view
  HandEyeView view;
  std::vector<HandEyePose> poses;
  /** Of a mobile base's camera above the base's frame, where tf knows it [m]; NaN: it does not. */
  double camera_height = std::numeric_limits<double>::quiet_NaN();
  std::string comment;  ///< one line; is written, not read
};

/**
 * Reads a file as writeHandEyePosesFile() writes it: `parameters` as in a HandEyeFile; `camera_height`, if it is known;
 * `view` with name, camera_matrix (9 numbers by rows) and corners (4 pairs); `poses`, each with flange (x, y, z, qx,
 * qy, qz, qw) and homography (9 numbers by rows, x_cur ~ H x_view).
 * @throws std::runtime_error naming the file and what is wrong with it.
 */
HandEyePosesFile readHandEyePosesFile(const std::string& path);

/** Writes such a file in one step. @throws std::runtime_error naming the file when it cannot be written. */
void writeHandEyePosesFile(const HandEyePosesFile& poses, const std::string& path);

}  // namespace view_servo
