// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/puma_robot.h"
#include "sim_ros/simulation_node.h"

#include <geometry_msgs/TwistStamped.h>
#include <ros/package.h>
#include <ros/publisher.h>
#include <sensor_msgs/JointState.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
/** The parameter robot_description, which robot_state_publisher reads too, or else the package's own file. */
std::string robotDescription(const ros::NodeHandle& nh)
{
  std::string description;
  if (nh.getParam("robot_description", description))
  {
    return description;
  }
  const std::string file = ros::package::getPath("view_servo") + "/urdf/puma560.urdf";
  std::ifstream stream(file);
  if (!stream)
  {
    throw std::runtime_error(file + " cannot be read, and robot_description is not set");
  }
  return { std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>() };
}

/**
 * What SimulationNode needs to know of the arm. The URDF comes from `robot_description`, else from the package.
 *
 * Parameters: see PumaParams.
 *
 * Subscribes:
 *  - `cmd_vel` (geometry_msgs/TwistStamped): twist of the camera in its optical frame; another frame_id is refused.
 *
 * Publishes:
 *  - `joint_states` (sensor_msgs/JointState); a robot_state_publisher makes tf of it.
 */
class PumaInterface
{
public:
  using Robot = PumaRobot;
  using Params = PumaParams;
  using Command = geometry_msgs::TwistStamped;
  static constexpr RobotKind KIND = RobotKind::PUMA;

  static std::unique_ptr<PumaRobot> makeRobot(const World& world, const Params& params, const ros::NodeHandle& nh)
  {
    return std::make_unique<PumaRobot>(world, robotDescription(nh), params);
  }

  PumaInterface(const PumaRobot& /*robot*/, const FrameNames& frames, ros::NodeHandle& nh)
    : camera_frame_(frames(CAMERA_FRAME)), joints_publisher_(nh.advertise<sensor_msgs::JointState>("joint_states", 50))
  {
  }

  std::optional<Robot::Twist> toTwist(const Command& message) const
  {
    if (message.header.frame_id != camera_frame_)
    {
      ROS_ERROR_STREAM_THROTTLE(
          1.0, "twists must be in " << camera_frame_ << ", not in '" << message.header.frame_id << "'");
      return std::nullopt;
    }
    const auto& linear = message.twist.linear;
    const auto& angular = message.twist.angular;
    Robot::Twist twist;
    twist << linear.x, linear.y, linear.z, angular.x, angular.y, angular.z;
    return twist;
  }

  void publish(PumaRobot& robot, const ros::Time& stamp)
  {
    joints_publisher_.publish(*robot.readSensors(stamp).joints);
    if (isHindered(robot.puma()))
    {
      ROS_WARN_STREAM_THROTTLE(2.0, robot.puma().message());
    }
  }

  static void diagnose(const PumaRobot& robot, diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const bool hindered = isHindered(robot.puma());
    status.summary(hindered ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   hindered ? robot.puma().message() : "follows");
  }

private:
  static bool isHindered(const Puma& puma)
  {
    return puma.state() == Puma::State::AT_LIMIT || puma.state() == Puma::State::NEAR_SINGULARITY;
  }

  std::string camera_frame_;
  ros::Publisher joints_publisher_;
};

}  // namespace
}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::sim::SimulationNode<view_servo::sim::PumaInterface>>(argc, argv, "puma_sim");
}
