// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/finding.h"
#include "check/observations.h"

namespace view_servo::check
{
/** @file
 * What measured numbers mean for homing and servoing, and what to do. Each function returns a finding for each name in
 * its comment; such a name is Finding::name.
 */

/** "images", "picture", "sharpness", "camera_info", "calibration", "image stamps". */
Findings judgeCamera(const CameraObservations& camera);

/** "picture" and, where there is enough light, "sharpness"; also of a part of a picture. */
Findings judgePicture(const PictureMeasures& picture);

/** "camera frame" and "tf", and for a base "camera mount". @param is_arm whether the camera is in an arm's hand. */
Findings judgeMount(const MountObservations& mount, bool is_arm);

/**
 * "odometry", "odometry frames", "odometry stamps", "clocks" and "odometry at rest". @param image_age as
 * StreamObservations::age [s].
 */
Findings judgeOdometry(const OdometryObservations& odometry, double image_age);

/** "commands". */
Findings judgeCommands(const CommandObservations& commands);

/** "joint states". */
Findings judgeJoints(const JointObservations& joints);

/** "time", "views' disk" and "processor". */
Findings judgeMachine(const MachineObservations& machine);

/** A topic on which nothing came, in words: whether nobody publishes it, or somebody does and is silent. */
std::string silence(const StreamObservations& stream, const std::string& what);

}  // namespace view_servo::check
