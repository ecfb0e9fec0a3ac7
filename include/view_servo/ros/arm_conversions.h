// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/views/view_store.h"

#include <ros/node_handle.h>
#include <std_msgs/Header.h>

#include <map>
#include <set>
#include <string>

namespace view_servo
{
/** @file
 * Between the core's types for an arm and messages.
 */

/**
 * What servoing to a stored view needs: the camera's matrix and image size once distortion is removed, and the middle
 * of the view's region there, which is the chosen point.
 * @param camera that is there now. @throws std::runtime_error naming the view when this camera cannot show that point,
 * and as cameraOf() does.
 */
ServoTarget servoTargetOf(const StoredView& view, const Camera& camera);

/**
 * A valid homography as servoing takes it. @throws std::runtime_error naming a number that leaves the range stated in
 * Homography.msg.
 */
PlaneView toPlaneView(const Homography& message);

/**
 * The errors of servoing after an image. They are NaN unless servoing drives or has converged.
 * @param header of the image. @param distance_known whether the plane's distance is known, so that translations are in
 * metres.
 */
ServoError toServoError(const ServoReport& report, const ServoTarget& target, bool distance_known,
                        const std_msgs::Header& header);

/**
 * The limits of a URDF's joints by name [rad] or [m]. None when the text is empty; none, with a warning, when it cannot
 * be read.
 */
std::map<std::string, JointLimits> jointLimits(const std::string& urdf_xml);

/**
 * The joints that move a link of a URDF: those between it and the root that are not fixed.
 * @param frame the link's name, perhaps with a leading slash, or with a prefix that ends with a slash.
 * @return empty when there is no such link.
 */
std::set<std::string> jointsMoving(const std::string& urdf_xml, const std::string& frame);

/** The parameter `robot_description`, of a namespace or of one above it; empty when there is none. */
std::string robotDescription(const ros::NodeHandle& nh);

/** Names of a URDF's joints that can move and mimic no other; empty when the text is empty or cannot be read. */
std::set<std::string> movableJoints(const std::string& urdf_xml);

/** Likewise of those that mimic others: who publishes an arm's states may publish theirs, too, or not. */
std::set<std::string> mimicJoints(const std::string& urdf_xml);

}  // namespace view_servo
