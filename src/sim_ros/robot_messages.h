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
 * The messages of simulated robots, the same from nodes and in bags. Their frames follow REP 105 and 103: `odom` ->
 * `base_link` -> `camera_optical_frame`; the Puma has no `odom`. `world`, the frame of the ground truth, is in no tf
 * tree.
 */

constexpr char WORLD_FRAME[] = "world";
constexpr char ODOM_FRAME[] = "odom";
constexpr char BASE_FRAME[] = "base_link";
constexpr char CAMERA_FRAME[] = "camera_optical_frame";

/** Names of a robot's frames: robots that share one /tf have different prefixes. */
class FrameNames
{
public:
  /**
   * @param prefix put before names, with a slash between, as robot_state_publisher does; empty: names stay as they are.
   */
  explicit FrameNames(const std::string& prefix);

  /** The name of a frame with the prefix before it. */
  std::string operator()(const std::string& frame) const
  {
    return prefix_ + frame;
  }
  /** The message with the prefix before its frame_id and child_frame_id. */
  geometry_msgs::TransformStamped operator()(geometry_msgs::TransformStamped transform) const;
  nav_msgs::Odometry operator()(nav_msgs::Odometry odometry) const;

private:
  std::string prefix_;  // empty, or with a slash at its end
};

/** A pose [m] as a message. */
geometry_msgs::Pose toPose(const Eigen::Isometry3d& pose);
/** @throws std::invalid_argument when the pose is not finite or its quaternion is not of length 1 (within 1 %). */
Eigen::Isometry3d toIsometry(const geometry_msgs::Pose& pose);

/** The transform from `child` to `parent`. @param pose parent from child. */
geometry_msgs::TransformStamped toTransform(const Eigen::Isometry3d& pose, const std::string& parent,
                                            const std::string& child, const ros::Time& stamp);

/** The true pose of the camera in `world`. @param camera world from the true camera's optical frame [m]. */
geometry_msgs::PoseStamped toGroundTruth(const Eigen::Isometry3d& camera, const ros::Time& stamp);

/** The odometry of the base: its pose in `odom`, its velocity in `base_link`. */
nav_msgs::Odometry toOdometry(const Nomad& nomad, const ros::Time& stamp);

/** The state of the arm's joints: positions as `measured` [rad], the true velocities [rad/s]. */
sensor_msgs::JointState toJointState(const Puma& puma, const Puma::Joints& measured, const ros::Time& stamp);

/**
 * The calibration that a robot believes its camera to have.
 * @param focal_length_error part by which its focal lengths are too long: 0.01 is one per cent.
 */
sensor_msgs::CameraInfo toCameraInfo(const World& world, double focal_length_error, const ros::Time& stamp);

}  // namespace view_servo::sim
