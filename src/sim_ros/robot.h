// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <string>

namespace view_servo::sim
{
/** What a robot's sensors, other than its camera, say at one time. */
struct SensorMessages
{
  std::optional<nav_msgs::Odometry> odometry;     ///< of a base
  std::optional<sensor_msgs::JointState> joints;  ///< of an arm
  geometry_msgs::TransformStamped transform;      ///< that follows from them: `odom` or `base_link` from its child
};

/**
 * A simulated robot that carries a camera, as nodes and bags see it. The frame that it is placed and commanded by is
 * the one whose poses a World holds: `base_link` of a base, the camera's optical frame of an arm.
 */
class Robot
{
public:
  using Twist = Eigen::Matrix<double, 6, 1>;  ///< [v; ω] [m/s, rad/s]

  virtual ~Robot() = default;

  /**
   * Puts the robot there at once, at rest.
   * @param pose world from that frame.
   * @throws std::invalid_argument when the robot cannot be there.
   */
  virtual void setPose(const Eigen::Isometry3d& pose) = 0;

  /** World from that frame, the true one. */
  virtual Eigen::Isometry3d pose() const = 0;

  /** World from the true camera's optical frame. */
  virtual Eigen::Isometry3d cameraPose() const = 0;

  /**
   * Sets what to do from now on: the twist of that frame, in that frame. A base uses only v_x, v_y and ω_z of it.
   * @return false, and nothing changes, when what is used of it is not finite.
   */
  virtual bool command(const Twist& twist) = 0;

  /** Stops at once, as by its brakes. */
  virtual void halt() = 0;

  /** Simulates the next `dt` [s], > 0. */
  virtual void step(double dt) = 0;

  /** Why the robot could not follow its command in the last step; empty when it could. */
  virtual std::string obstruction() const = 0;

  /** A reading of all sensors but the camera. Their noise is new at every call. */
  virtual SensorMessages readSensors(const ros::Time& stamp) = 0;

  /** `base_link` from the camera where that is fixed; empty where joints move it. */
  virtual std::optional<geometry_msgs::TransformStamped> cameraMount(const ros::Time& stamp) const = 0;
};

}  // namespace view_servo::sim
