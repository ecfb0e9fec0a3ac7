// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/finding.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/planar_pose.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include <optional>
#include <string>

namespace view_servo::check
{
/**
 * A small motion of a base, or of a camera in an arm's hand, in the frame that it had before: REP 103's base frame, or
 * the optical frame.
 */
struct Motion
{
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< [m]; by images it has length 1, or is zero
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();     ///< axis times angle [rad]
};

/** @param after_in_before pose after the motion, in the frame before it. */
Motion toMotion(const Eigen::Isometry3d& after_in_before);
Motion toMotion(const PlanarPose& after_in_before);

/** What two images say of the motion between them. */
struct SeenMotion
{
  std::optional<Motion> motion;  ///< empty: the images do not tell one
  int matches = 0;               ///< number of matches that agree with the motion
  double shift = 0.0;            ///< median distance by which these moved in the image [px]
  std::string fault;             ///< why there is no motion, in one line; empty: there is one
};

/** Two images of one camera, 8-bit grey. */
struct ImagePair
{
  cv::Mat before;
  cv::Mat after;
  Camera camera;
};

/**
 * The motion of a base on a level floor. Images tell the camera's motion but not its length.
 * @param measured pose of the base after the motion in the base before it, by odometry [m, rad]. The length of its way
 * is taken for the camera's, so that the base's motion follows from where the camera is mounted.
 */
SeenMotion seenByBase(const ImagePair& images, const CameraMount& mount, const PlanarPose& measured);

/**
 * The motion of a camera in an arm's hand, by the homography of the plane that most matches lie on. Two motions explain
 * a homography; the one nearer to `measured` is taken. Where none is possible and a turn explains the matches, the
 * camera has turned alone.
 */
SeenMotion seenByHand(const ImagePair& images, const Motion& measured);

/** One part of the test drive, there or back. */
struct Leg
{
  std::string name;         ///< "forward", for example
  bool turns = false;       ///< whether it is a turn; if not, it is a translation
  Motion asked;             ///< what was commanded, or what somebody was asked to do by hand
  bool by_hand = false;     ///< somebody moved the robot by hand, so only roughly as asked
  std::string measured_by;  ///< "odometry" or "tf"
  Motion measured;          ///< the motion by that
  SeenMotion seen;          ///< the motion by the images before and after it
};

/**
 * Compares the three: who of command, odometry or tf, and images disagrees with the two others in sign and direction,
 * and by how much lengths and angles differ. Of a translation images tell the direction alone.
 */
Finding judgeLeg(const Leg& leg);

}  // namespace view_servo::check
