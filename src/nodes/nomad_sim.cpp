// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/nomad.h"
#include "sim_ros/simulation_node.h"

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/publisher.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>

#include <cstdint>

namespace view_servo::sim
{
namespace
{
/**
 * The base, as a SimulationNode wants it.
 *
 * Parameters:
 *  - `~odometry_drift` (double, default 0): distance measured too long, as a part of it;
 *  - `~odometry_turn_drift` (double, default 0 [rad/m]): turn that odometry adds;
 *  - `~odometry_noise` (double, default 0): sd of each cycle's measured motion, as a part of it;
 *  - `~max_speed` (double, default 0.5 [m/s]), `~max_turn_rate` (double, default 1 [rad/s]), `~max_acceleration`
 *    (double, default 1 [m/s²]), `~max_turn_acceleration` (double, default 2 [rad/s²]).
 *
 * Subscribes:
 *  - `cmd_vel` (geometry_msgs/Twist): linear.x, linear.y and angular.z, in base_link.
 *
 * Publishes:
 *  - `odom` (nav_msgs/Odometry), `/tf` odom -> base_link, `/tf_static` base_link -> camera_optical_frame.
 */
class NomadRobot
{
public:
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

  NomadRobot(const World& world, std::uint64_t seed, const Params& params, ros::NodeHandle& nh)
    : nomad_(world, seeded(params, seed)), odometry_publisher_(nh.advertise<nav_msgs::Odometry>("odom", 50))
  {
    static_broadcaster_.sendTransform(toTransform(world.camera_on_base, BASE_FRAME, CAMERA_FRAME, ros::Time::now()));
  }

  bool command(const Command& twist)
  {
    return nomad_.command({ twist.linear.x, twist.linear.y, twist.angular.z });
  }
  void halt()
  {
    nomad_.halt();
  }
  void step(double dt)
  {
    nomad_.step(dt);
  }
  void setPose(const Eigen::Isometry3d& base)
  {
    nomad_.setPose(base);
  }
  Eigen::Isometry3d cameraPose() const
  {
    return nomad_.cameraPose();
  }
  void publish(const ros::Time& stamp)
  {
    odometry_publisher_.publish(toOdometry(nomad_, stamp));
    broadcaster_.sendTransform(toTransform(nomad_.odometry(), ODOM_FRAME, BASE_FRAME, stamp));
  }
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
  {
    if (nomad_.blockedBy().empty())
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "drives");
    }
    else
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "stopped by " + nomad_.blockedBy());
    }
  }

private:
  static NomadParams seeded(NomadParams params, std::uint64_t seed)
  {
    params.seed = seed;
    return params;
  }

  Nomad nomad_;
  ros::Publisher odometry_publisher_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
};

}  // namespace
}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::sim::SimulationNode<view_servo::sim::NomadRobot>>(argc, argv, "nomad_sim");
}
