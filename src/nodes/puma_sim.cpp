// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/puma.h"
#include "sim_ros/simulation_node.h"

#include <geometry_msgs/TwistStamped.h>
#include <ros/package.h>
#include <ros/publisher.h>
#include <sensor_msgs/JointState.h>

#include <cstdint>
#include <fstream>
#include <iterator>
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
 * The arm, as a SimulationNode wants it. The URDF comes from `robot_description`, else from the package.
 *
 * Parameters:
 *  - `~encoder_noise` (double, default 0 [rad]): sd of each reading;
 *  - `~hand_eye_translation_error` (double, default 0 [m]), `~hand_eye_rotation_error` (double, default 0 [rad]): of
 *    the true camera from where the URDF has it, in a seeded direction.
 *
 * Subscribes:
 *  - `cmd_vel` (geometry_msgs/TwistStamped): twist of the camera in its optical frame; another frame_id is refused.
 *
 * Publishes:
 *  - `joint_states` (sensor_msgs/JointState); a robot_state_publisher makes tf of it.
 */
class PumaRobot
{
public:
  using Command = geometry_msgs::TwistStamped;
  static constexpr RobotKind KIND = RobotKind::PUMA;

  struct Params : PumaParams
  {
    void read(ParameterReader& reader)
    {
      reader.read("encoder_noise", encoder_noise);
      reader.read("hand_eye_translation_error", hand_eye_translation_error);
      reader.read("hand_eye_rotation_error", hand_eye_rotation_error);
      reader.addFaults(validate());
    }
  };

  PumaRobot(const World& world, std::uint64_t seed, const Params& params, ros::NodeHandle& nh)
    : base_(world.robot_base),
      puma_(robotDescription(nh), seeded(params, seed)),
      joints_publisher_(nh.advertise<sensor_msgs::JointState>("joint_states", 50))
  {
  }

  bool command(const Command& message)
  {
    if (message.header.frame_id != CAMERA_FRAME)
    {
      ROS_ERROR_STREAM_THROTTLE(1.0,
                                "twists must be in " << CAMERA_FRAME << ", not in '" << message.header.frame_id << "'");
      return false;
    }
    const auto& linear = message.twist.linear;
    const auto& angular = message.twist.angular;
    Puma::Twist twist;
    twist << linear.x, linear.y, linear.z, angular.x, angular.y, angular.z;
    return puma_.command(twist);
  }
  void halt()
  {
    puma_.halt();
  }
  void step(double dt)
  {
    puma_.step(dt);
  }
  void setPose(const Eigen::Isometry3d& camera)
  {
    if (!puma_.setCameraPose(base_.inverse() * camera))
    {
      throw std::invalid_argument("the arm cannot bring its camera there");
    }
  }
  Eigen::Isometry3d cameraPose() const
  {
    return base_ * puma_.cameraPose();
  }
  void publish(const ros::Time& stamp)
  {
    joints_publisher_.publish(toJointState(puma_, puma_.measuredJoints(), stamp));
    if (puma_.state() == Puma::State::AT_LIMIT || puma_.state() == Puma::State::NEAR_SINGULARITY)
    {
      ROS_WARN_STREAM_THROTTLE(2.0, puma_.message());
    }
  }
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
  {
    const bool hindered = puma_.state() == Puma::State::AT_LIMIT || puma_.state() == Puma::State::NEAR_SINGULARITY;
    status.summary(hindered ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   hindered ? puma_.message() : "follows");
  }

private:
  static PumaParams seeded(PumaParams params, std::uint64_t seed)
  {
    params.seed = seed;
    return params;
  }

  Eigen::Isometry3d base_;
  Puma puma_;
  ros::Publisher joints_publisher_;
};

}  // namespace
}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::sim::SimulationNode<view_servo::sim::PumaRobot>>(argc, argv, "puma_sim");
}
