// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/world.h"
#include "sim_ros/robot.h"

namespace view_servo::sim
{
/** The base, with its messages: odometry and `odom` -> `base_link`. */
class NomadRobot final : public Robot
{
public:
  /** Starts at the world's goal. The world must outlive the robot. @throws std::invalid_argument as Nomad does. */
  NomadRobot(const World& world, const NomadParams& params);

  void setPose(const Eigen::Isometry3d& pose) override;
  Eigen::Isometry3d pose() const override;
  Eigen::Isometry3d cameraPose() const override;
  bool command(const Twist& twist) override;
  void halt() override;
  void step(double dt) override;
  std::string obstruction() const override;
  SensorMessages readSensors(const ros::Time& stamp) override;
  std::optional<geometry_msgs::TransformStamped> cameraMount(const ros::Time& stamp) const override;

  const Nomad& nomad() const
  {
    return nomad_;
  }

private:
  const World& world_;
  Nomad nomad_;
};

}  // namespace view_servo::sim
