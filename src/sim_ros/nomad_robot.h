// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/world.h"
#include "sim_ros/robot.h"
#include "sim_ros/robot_messages.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Geometry>

#include <string>
#include <vector>

namespace view_servo::sim
{
/** Names of the base's frames, and where base_link is: makes of bases differ in them. */
struct NomadFrames
{
  std::string odom = ODOM_FRAME;  ///< in which odometry tells poses
  std::string footprint;          ///< on the floor below base_link, and what odometry is of; empty: there is none
  double base_link_height = 0.0;  ///< of base_link above the floor [m]
};

/** The parameters of the node nomad_sim that are of the base. */
struct NomadNodeParams : NomadParams
{
  NomadFrames frames;

  /** As NomadParams::validate(). */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(NomadNodeParams& params);

/** The base, with its messages: odometry, `odom` -> `base_link` and, where there is one, its footprint between them. */
class NomadRobot final : public Robot
{
public:
  /** Starts at the world's goal. The world must outlive the robot. @throws std::invalid_argument as Nomad does. */
  NomadRobot(const World& world, const NomadParams& params, NomadFrames frames = NomadFrames());

  void setPose(const Eigen::Isometry3d& pose) override;
  Eigen::Isometry3d pose() const override;
  Eigen::Isometry3d cameraPose() const override;
  bool command(const Twist& twist) override;
  void halt() override;
  void step(double dt) override;
  std::string obstruction() const override;
  SensorMessages readSensors(const ros::Time& stamp) override;
  std::optional<geometry_msgs::TransformStamped> cameraMount(const ros::Time& stamp) const override;
  /** The footprint from base_link; empty when there is no footprint. */
  std::optional<geometry_msgs::TransformStamped> footprintMount(const ros::Time& stamp) const;

  const Nomad& nomad() const
  {
    return nomad_;
  }

private:
  const World& world_;
  NomadFrames frames_;
  Eigen::Isometry3d base_link_;  // the place on the floor below base_link, from base_link
  Nomad nomad_;
};

}  // namespace view_servo::sim
