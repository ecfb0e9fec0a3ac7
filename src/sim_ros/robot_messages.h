// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/puma.h"

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/JointState.h>

#include <string>

namespace view_servo::sim
{
/** @file
 * What the simulated robots tell, the same live and in bags. Frames, by REP 105 and 103: `odom` -> `base_link` ->
 * `camera_optical_frame`; the Puma has no `odom`. `world`, of the ground truth alone, is in no tf tree.
 */

constexpr char WORLD_FRAME[] = "world";
constexpr char ODOM_FRAME[] = "odom";
constexpr char BASE_FRAME[] = "base_link";
constexpr char CAMERA_FRAME[] = "camera_optical_frame";

geometry_msgs::Pose toPose(const Eigen::Isometry3d& pose);
/** @throws std::invalid_argument when it is not finite or its quaternion is not of length 1 (within 1 %). */
Eigen::Isometry3d toIsometry(const geometry_msgs::Pose& pose);

/** Target <- source: the pose of `child` in `parent`. */
geometry_msgs::TransformStamped toTransform(const Eigen::Isometry3d& pose, const std::string& parent,
                                            const std::string& child, const ros::Time& stamp);

/** The camera's true pose in the world. */
geometry_msgs::PoseStamped toGroundTruth(const Eigen::Isometry3d& camera, const ros::Time& stamp);

/** What the base's odometry says: the pose in `odom`, the velocity in `base_link`. */
nav_msgs::Odometry toOdometry(const Nomad& nomad, const ros::Time& stamp);

/** What the arm's encoders say, given one reading of them. */
sensor_msgs::JointState toJointState(const Puma& puma, const Puma::Joints& measured, const ros::Time& stamp);

/**
 * The calibration that a robot has of its camera.
 * @param focal_length_error by which part the focal lengths are too long.
 */
sensor_msgs::CameraInfo toCameraInfo(const World& world, double focal_length_error, const ros::Time& stamp);

}  // namespace view_servo::sim
