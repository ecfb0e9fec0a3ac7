// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/servo_25d.h"

#include <std_msgs/Header.h>

#include <map>
#include <string>

namespace view_servo
{
/** @file
 * Between the core's types for an arm and messages.
 */

/** What a valid homography says. @throws std::runtime_error naming a number that is out of the range that Homography.msg states. */
PlaneView toPlaneView(const Homography& message);

/**
 * What servoing does after an image. Errors are NaN unless it drives or has converged.
 * @param header of the image. @param distance_known whether the plane's distance is known, so that translations are metres.
 */
ServoError toServoError(const ServoReport& report, const ServoTarget& target, bool distance_known,
                        const std_msgs::Header& header);

/** The limits of a URDF's joints by name [rad] or [m]; none, with a warning, when it cannot be read; none when it is empty. */
std::map<std::string, JointLimits> jointLimits(const std::string& urdf_xml);

}  // namespace view_servo
