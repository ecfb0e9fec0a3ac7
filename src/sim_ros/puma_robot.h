// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/puma.h"
#include "sim/world.h"
#include "sim_ros/robot.h"

namespace view_servo::sim
{
/** The arm where a world has its base, with its messages: joint states, and `base_link` -> camera by what they say. */
class PumaRobot final : public Robot
{
public:
  /** Starts as Puma does, not at the world's goal. @throws std::invalid_argument as Puma does. */
  PumaRobot(const World& world, const std::string& urdf_xml, const PumaParams& params);

  void setPose(const Eigen::Isometry3d& pose) override;
  Eigen::Isometry3d pose() const override;
  Eigen::Isometry3d cameraPose() const override;
  bool command(const Twist& twist) override;
  void halt() override;
  void step(double dt) override;
  std::string obstruction() const override;
  SensorMessages readSensors(const ros::Time& stamp) override;
  std::optional<geometry_msgs::TransformStamped> cameraMount(const ros::Time& stamp) const override;

  const Puma& puma() const
  {
    return puma_;
  }

private:
  Eigen::Isometry3d world_from_base_;
  Puma puma_;
};

}  // namespace view_servo::sim
