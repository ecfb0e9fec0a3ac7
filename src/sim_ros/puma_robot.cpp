// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/puma_robot.h"

#include "sim_ros/robot_messages.h"

#include <stdexcept>

namespace view_servo::sim
{
PumaRobot::PumaRobot(const World& world, const std::string& urdf_xml, const PumaParams& params)
  : world_from_base_(world.robot_base), puma_(urdf_xml, params)
{
}

void PumaRobot::setPose(const Eigen::Isometry3d& pose)
{
  if (!puma_.setCameraPose(world_from_base_.inverse() * pose))
  {
    throw std::invalid_argument("the arm cannot bring its camera there");
  }
}

Eigen::Isometry3d PumaRobot::pose() const
{
  return cameraPose();
}

Eigen::Isometry3d PumaRobot::cameraPose() const
{
  return world_from_base_ * puma_.cameraPose();
}

bool PumaRobot::command(const Twist& twist)
{
  return puma_.command(twist);
}

void PumaRobot::halt()
{
  puma_.halt();
}

void PumaRobot::step(double dt)
{
  puma_.step(dt);
}

std::string PumaRobot::obstruction() const
{
  return puma_.state() == Puma::State::AT_LIMIT ? puma_.message() : "";
}

SensorMessages PumaRobot::readSensors(const ros::Time& stamp)
{
  const Puma::Joints joints = puma_.measuredJoints();
  SensorMessages messages;
  messages.joints = toJointState(puma_, joints, stamp);
  messages.transform = toTransform(puma_.nominalCameraPose(joints), BASE_FRAME, CAMERA_FRAME, stamp);
  return messages;
}

std::optional<geometry_msgs::TransformStamped> PumaRobot::cameraMount(const ros::Time& /*stamp*/) const
{
  return std::nullopt;
}

}  // namespace view_servo::sim
