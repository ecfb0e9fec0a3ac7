// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/nomad_robot.h"
#include "sim_ros/simulation_node.h"

#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/publisher.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo::sim
{
namespace
{
/**
 * What SimulationNode needs to know of the base.
 *
 * Parameters: see NomadNodeParams.
 *
 * Subscribes:
 *  - `cmd_vel` (geometry_msgs/Twist): linear.x, linear.y and angular.z, in base_link.
 *
 * Publishes:
 *  - `odom` (nav_msgs/Odometry), `/tf` odom -> base_link, `/tf_static` base_link -> camera_optical_frame; with
 *    `~footprint_frame` odometry and `/tf` are of that one, and `/tf_static` has it -> base_link.
 */
class NomadInterface
{
public:
  using Robot = NomadRobot;
  using Params = NomadNodeParams;
  using Command = geometry_msgs::Twist;
  static constexpr RobotKind KIND = RobotKind::NOMAD;

  static std::unique_ptr<NomadRobot> makeRobot(const World& world, const Params& params, const ros::NodeHandle& /*nh*/)
  {
    return std::make_unique<NomadRobot>(world, params, params.frames);
  }

  NomadInterface(const NomadRobot& robot, FrameNames frames, ros::NodeHandle& nh)
    : frames_(std::move(frames)), odometry_publisher_(nh.advertise<nav_msgs::Odometry>("odom", 50))
  {
    const ros::Time now = ros::Time::now();
    std::vector<geometry_msgs::TransformStamped> mounts = { frames_(*robot.cameraMount(now)) };
    if (const auto footprint = robot.footprintMount(now))
    {
      mounts.push_back(frames_(*footprint));
    }
    static_broadcaster_.sendTransform(mounts);
  }

  static std::optional<Robot::Twist> toTwist(const Command& message)
  {
    Robot::Twist twist = Robot::Twist::Zero();
    twist(0) = message.linear.x;
    twist(1) = message.linear.y;
    twist(5) = message.angular.z;
    return twist;
  }

  void publish(NomadRobot& robot, const ros::Time& stamp)
  {
    const SensorMessages messages = robot.readSensors(stamp);
    odometry_publisher_.publish(frames_(*messages.odometry));
    broadcaster_.sendTransform(frames_(messages.transform));
  }

  static void diagnose(const NomadRobot& robot, diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::string& obstacle = robot.nomad().blockedBy();
    if (obstacle.empty())
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "drives");
    }
    else
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "stopped by " + obstacle);
    }
  }

private:
  FrameNames frames_;
  ros::Publisher odometry_publisher_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
};

}  // namespace
}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::sim::SimulationNode<view_servo::sim::NomadInterface>>(argc, argv, "nomad_sim");
}
