// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/base_run.h"
#include "sim_ros/simulated_run.h"
#include "view_servo/FollowRouteAction.h"
#include "view_servo/StartRoute.h"
#include "view_servo/ros/base_conversions.h"

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
/** Drives a base as somebody with a joystick does, by odometry. */
class Joystick
{
public:
  explicit Joystick(ros::NodeHandle& nh)
    : commands_(nh.advertise<geometry_msgs::Twist>("cmd_vel", 1)),
      odometry_(nh.subscribe("odom", 5, &Joystick::onOdometry, this))
  {
  }

  /** Straight to a pose in the base. @throws std::runtime_error when it does not come there. */
  void drive(const PlanarPose& way, double patience)
  {
    constexpr double PERIOD = 0.05;     // of commands [s]
    constexpr double TOLERANCE = 0.01;  // [m]
    constexpr double SPEED = 0.2;       // [m/s]
    constexpr double TURN_RATE = 0.3;   // [rad/s]
    constexpr double SLOWEST = 0.1;     // expected over all [m/s]
    std::optional<PlanarPose> target;
    auto next = std::chrono::steady_clock::now();
    const std::string missing = waitUntilReady(patience + way.distance() / SLOWEST, [&]() -> std::string {
      const std::optional<PlanarPose> base = newest();
      if (!base)
      {
        return "no odometry comes on '" + odometry_.getTopic() + "'";
      }
      target = target ? *target : compose(*base, way);
      const PlanarPose left = compose(inverse(*base), *target);
      if (left.distance() < TOLERANCE)
      {
        commands_.publish(geometry_msgs::Twist());
        return "";
      }
      if (std::chrono::steady_clock::now() >= next)
      {
        next += std::chrono::milliseconds(static_cast<int>(1e3 * PERIOD));
        const double speed = std::min(SPEED, std::max(0.03, left.distance()));
        geometry_msgs::Twist twist;
        twist.linear.x = speed * std::cos(left.heading());
        twist.linear.y = speed * std::sin(left.heading());
        twist.angular.z = std::clamp(left.yaw, -TURN_RATE, TURN_RATE);
        commands_.publish(twist);
      }
      return "the base does not come to the end of the route";
    });
    if (!missing.empty())
    {
      throw std::runtime_error(ros::ok() ? "waited in vain: " + missing : "interrupted");
    }
  }

private:
  void onOdometry(const nav_msgs::Odometry::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    base_ = toPlanarPose(*message);
  }
  std::optional<PlanarPose> newest() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return base_;
  }

  mutable std::mutex mutex_;
  std::optional<PlanarPose> base_;
  ros::Publisher commands_;
  ros::Subscriber odometry_;
};

RunOutcome run(ros::NodeHandle& nh, const sim::World& world, const RunParams& params)
{
  SimulatedRun<FollowRouteAction> simulation(nh, params, "nomad_sim", "route_follower", "follow");
  simulation.waitForOthers({ "route_recorder/start", "route_recorder/stop" });
  Joystick joystick(nh);
  const Eigen::Isometry3d start = parseStart(world, params.start);
  simulation.moveTo(start, start * world.camera_on_base);
  StartRoute begin;
  begin.request.name = params.view;
  simulation.call("route_recorder/start", begin);
  joystick.drive(compose(inverse(toPlanar(start)), toPlanar(world.goal)), params.patience);
  const Eigen::Isometry3d goal = simulation.rest();
  std_srvs::Trigger stop;
  simulation.call("route_recorder/stop", stop);
  ROS_INFO_STREAM(stop.response.message);
  const Eigen::Isometry3d beside = start * sim::planarPose(0.0, 0.1, 0.03);  // nobody puts it exactly where it was
  simulation.moveTo(beside, beside * world.camera_on_base);
  FollowRouteGoal order;
  order.route = params.view;
  order.timeout = params.timeout;
  const FollowRouteResult result = simulation.drive(order);
  const bool success = result.success != 0;
  return { success, std::string(success ? "arrived" : "not arrived") + " (" + result.message +
                        "): " + describeEnd(goal, simulation.rest(), result.travelled, result.duration) };
}

}  // namespace
}  // namespace view_servo

/**
 * Records a route in simulation, from a start to the world's goal, has it followed once, and says how far off the base
 * ends. Parameters: see runSimulation(); `~start` is "x y yaw" [m, m, rad], or the name of one of the world's starts;
 * `~view` is the route's name.
 */
int main(int argc, char** argv)
{
  return view_servo::runSimulation(argc, argv,
                                   { "run_route", "route",
                                     "Records a route of a mobile base in simulation, with the nodes of route.launch, "
                                     "has it followed once, and says how far off the base ends." },
                                   view_servo::routeRunParams(), view_servo::run);
}
