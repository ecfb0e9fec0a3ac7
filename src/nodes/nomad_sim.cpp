// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/nomad_robot.h"
#include "sim_ros/simulation_node.h"

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/publisher.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include <memory>
#include <optional>
#include <string>

namespace view_servo::sim
{
namespace
{
/**
 * What SimulationNode needs to know of the base.
 *
 * Parameters:
 *  - `~odometry_drift` (double, default 0): by which part odometry measures distances too long;
 *  - `~odometry_turn_drift` (double, default 0 [rad/m]): turn that odometry adds;
 *  - `~odometry_noise` (double, default 0): standard deviation of each cycle's measured motion, as a part of it;
 *  - `~max_speed` (double, default 0.5 [m/s]), `~max_turn_rate` (double, default 1 [rad/s]), `~max_acceleration`
 *    (double, default 1 [m/s²]), `~max_turn_acceleration` (double, default 2 [rad/s²]).
 *
 * Subscribes:
 *  - `cmd_vel` (geometry_msgs/Twist): linear.x, linear.y and angular.z, in base_link.
 *
 * Publishes:
 *  - `odom` (nav_msgs/Odometry), `/tf` odom -> base_link, `/tf_static` base_link -> camera_optical_frame.
 */
class NomadInterface
{
public:
  using Robot = NomadRobot;
  using Command = geometry_msgs::Twist;
  static constexpr RobotKind KIND = RobotKind::NOMAD;

  struct Params : NomadParams
  {
    void read(ParameterReader& reader)
    {
      reader.read("odometry_drift", odometry_drift);
      reader.read("odometry_turn_drift", odometry_turn_drift);
      reader.read("odometry_noise", odometry_noise);
      reader.read("max_speed", max_speed);
      reader.read("max_turn_rate", max_turn_rate);
      reader.read("max_acceleration", max_acceleration);
      reader.read("max_turn_acceleration", max_turn_acceleration);
      reader.addFaults(validate());
    }
  };

  static std::unique_ptr<NomadRobot> makeRobot(const World& world, const Params& params, const ros::NodeHandle& /*nh*/)
  {
    return std::make_unique<NomadRobot>(world, params);
  }

  NomadInterface(const NomadRobot& robot, ros::NodeHandle& nh)
    : odometry_publisher_(nh.advertise<nav_msgs::Odometry>("odom", 50))
  {
    static_broadcaster_.sendTransform(*robot.cameraMount(ros::Time::now()));
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
    odometry_publisher_.publish(*messages.odometry);
    broadcaster_.sendTransform(messages.transform);
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
