// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/nomad_robot.h"

#include "sim_ros/robot_messages.h"

namespace view_servo::sim
{
NomadRobot::NomadRobot(const World& world, const NomadParams& params) : world_(world), nomad_(world, params)
{
}

void NomadRobot::setPose(const Eigen::Isometry3d& pose)
{
  nomad_.setPose(pose);
}

Eigen::Isometry3d NomadRobot::pose() const
{
  return nomad_.pose();
}

Eigen::Isometry3d NomadRobot::cameraPose() const
{
  return nomad_.cameraPose();
}

bool NomadRobot::command(const Twist& twist)
{
  return nomad_.command({ twist(0), twist(1), twist(5) });
}

void NomadRobot::halt()
{
  nomad_.halt();
}

void NomadRobot::step(double dt)
{
  nomad_.step(dt);
}

std::string NomadRobot::obstruction() const
{
  return nomad_.blockedBy().empty() ? "" : nomad_.blockedBy() + " is in the way";
}

SensorMessages NomadRobot::readSensors(const ros::Time& stamp)
{
  SensorMessages messages;
  messages.odometry = toOdometry(nomad_, stamp);
  messages.transform = toTransform(nomad_.odometry(), ODOM_FRAME, BASE_FRAME, stamp);
  return messages;
}

std::optional<geometry_msgs::TransformStamped> NomadRobot::cameraMount(const ros::Time& stamp) const
{
  return toTransform(world_.camera_on_base, BASE_FRAME, CAMERA_FRAME, stamp);
}

}  // namespace view_servo::sim
