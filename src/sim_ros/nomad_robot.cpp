// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/nomad_robot.h"

#include "sim_ros/robot_messages.h"

#include <utility>

namespace view_servo::sim
{
std::vector<Parameter> parameters(NomadNodeParams& params)
{
  std::vector<Parameter> table = parameters(static_cast<NomadParams&>(params));
  table.insert(
      table.end(),
      { text("odom_frame", params.frames.odom, "frame of odometry's poses"),
        text("footprint_frame", params.frames.footprint,
             "frame on the floor below base_link, which odometry is of then, as base_footprint of other makes; "
             "empty: there is none, odometry is of base_link"),
        real("base_link_height", params.frames.base_link_height, "m", ">= 0", "of base_link above the floor") });
  return table;
}

std::vector<std::string> NomadNodeParams::validate() const
{
  return faultsOf(*this);
}

NomadRobot::NomadRobot(const World& world, const NomadParams& params, NomadFrames frames)
  : world_(world), frames_(std::move(frames)), base_link_(Eigen::Isometry3d::Identity()), nomad_(world, params)
{
  base_link_.translation().z() = frames_.base_link_height;
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
  const bool of_footprint = !frames_.footprint.empty();
  const Eigen::Isometry3d pose = of_footprint ? nomad_.odometry() : nomad_.odometry() * base_link_;
  messages.odometry = toOdometry(nomad_, stamp);
  messages.odometry->header.frame_id = frames_.odom;
  messages.odometry->child_frame_id = of_footprint ? frames_.footprint : BASE_FRAME;
  messages.odometry->pose.pose = toPose(pose);
  messages.transform = toTransform(pose, frames_.odom, messages.odometry->child_frame_id, stamp);
  return messages;
}

std::optional<geometry_msgs::TransformStamped> NomadRobot::cameraMount(const ros::Time& stamp) const
{
  return toTransform(base_link_.inverse() * world_.camera_on_base, BASE_FRAME, CAMERA_FRAME, stamp);
}

std::optional<geometry_msgs::TransformStamped> NomadRobot::footprintMount(const ros::Time& stamp) const
{
  if (frames_.footprint.empty())
  {
    return std::nullopt;
  }
  return toTransform(base_link_, frames_.footprint, BASE_FRAME, stamp);
}

}  // namespace view_servo::sim
