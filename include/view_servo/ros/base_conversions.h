// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/Heading.h"
#include "view_servo/PointMatch.h"
#include "view_servo/control/heading_vote.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/planar_pose.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>

#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Between the core's types for a mobile base and messages.
 */

/** The base's pose on the floor in the odometry frame; not finite where the message is not. */
PlanarPose toPlanarPose(const nav_msgs::Odometry& message);

/** A velocity in base_link as a message in the frame `base_frame`. */
geometry_msgs::TwistStamped toTwistStamped(const BaseVelocity& velocity, const ros::Time& stamp,
                                           const std::string& base_frame);

/**
 * Matches as pixels of the raw images, not as level points, weighted by their scores. Those whose score is negative or
 * not finite are left out.
 */
HeadingEvidence toHeadingEvidence(const std::vector<PointMatch>& matches);

/** The report as a message, stamped with its last image, with angles in `base_frame`. */
Heading toHeading(const HomingReport& report, const std::string& base_frame);

/** The base's pose at the view, with its covariance, in `odom_frame`. The report must have a goal_in_odom. */
geometry_msgs::PoseWithCovarianceStamped toViewPose(const HomingReport& report, const std::string& odom_frame);

/**
 * The base's pose, with its covariance, in the frame view_NAME, where the base is at the view NAME: x ahead, y to the
 * left. Of the covariance of the report's goal_in_odom, which it must have; odometry adds nothing to it.
 */
geometry_msgs::PoseWithCovarianceStamped toBasePose(const HomingReport& report, const std::string& view);

/** The direction to the view for rviz: a pose at the base with its x axis towards the view. */
geometry_msgs::PoseStamped toHeadingArrow(const HomingReport& report, const std::string& base_frame);

}  // namespace view_servo
