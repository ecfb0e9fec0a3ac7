// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "sim_ros/robot.h"
#include "sim_ros/robot_messages.h"
#include "sim_ros/simulation_params.h"
#include "view_servo/SetLight.h"
#include "view_servo/SetPose.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <image_transport/image_transport.h>
#include <ros/console.h>
#include <ros/param.h>
#include <ros/rate.h>
#include <ros/steady_timer.h>
#include <ros/subscriber.h>
#include <sensor_msgs/image_encodings.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo::sim
{
/**
 * The node of a simulated robot that carries a camera. It runs on wall time.
 *
 * Its private parameters are those of SimulationParams and of the robot.
 *
 * Publishes:
 *  - `camera/image_raw` (sensor_msgs/Image; drawn only when somebody listens), `camera/camera_info`, at the
 *    world's rate or as fast as it can be drawn;
 *  - `ground_truth` (geometry_msgs/PoseStamped): the camera's true pose in `world`, with the stamp of each image;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz;
 *  - the messages of the robot's other sensors.
 *
 * Subscribes:
 *  - `cmd_vel`: the command to follow until the next one comes, or for 0.2 s of wall time, after which the robot
 *    brakes.
 *
 * Services:
 *  - `~set_pose` (view_servo/SetPose), `~set_light` (view_servo/SetLight).
 *
 * The camera draws in a thread of its own, since that takes longer than a cycle of control.
 *
 * An Interface is how one kind of robot is reached over ROS. It has
 *  - the types `Robot` (a sim::Robot), `Command` (the message on `cmd_vel`) and `Params`, the robot's parameters, with
 *    `seed`, their table parameters(Params&) and validate(); and the constant `KIND`;
 *  - `static std::unique_ptr<Robot> makeRobot(world, params, node_handle)`;
 *  - a constructor from the robot, its FrameNames and a node handle, which advertises;
 *  - `std::optional<Robot::Twist> toTwist(command)`, empty when the command must be refused;
 *  - `publish(robot, stamp)`, which reads the robot's sensors, and `static diagnose(robot, status)`.
 */
template <typename Interface>
class SimulationNode : private NodeBase
{
public:
  SimulationNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh), images_(nh), last_step_(Clock::now())
  {
    bool sim_time = false;
    if (ros::param::get("/use_sim_time", sim_time) && sim_time)
    {
      throw std::runtime_error("/use_sim_time is set, but simulated robots run on wall time");
    }
    ParameterReader reader(private_nh_);
    typename Interface::Params robot_params;
    reader.read(parameters(params_));
    reader.read(parameters(robot_params));
    reader.addFaults(faultsOf(params_));
    reader.addFaults(robot_params.validate());
    reader.finish();
    robot_params.seed = params_.seed;
    world_ = withObstaclesOf(params_.load(Interface::KIND), params_.groupNames());
    camera_ = std::make_unique<SimulatedCamera>(world_, params_.groupNames(), params_.seed);
    robot_ = Interface::makeRobot(world_, robot_params, nh_);
    interface_ = std::make_unique<Interface>(*robot_, FrameNames(params_.frame_prefix), nh_);
    robot_->setPose(world_.goal);
    if (!params_.start.empty())
    {
      robot_->setPose(world_.start(params_.start));  // of an arm's solutions the one nearest to the goal's
    }

    image_publisher_ = images_.advertiseCamera("camera/image_raw", 2);
    ground_truth_publisher_ = nh_.advertise<geometry_msgs::PoseStamped>("ground_truth", 10);
    command_subscriber_ =
        subscribe<Command>("cmd_vel", 1, [this](const typename Command::ConstPtr& message) { command(message); });
    set_pose_service_ = serve("set_pose", &SimulationNode::setPose, this);
    set_light_service_ = serve("set_light", &SimulationNode::setLight, this);
    diagnostics_.add("robot", this, &SimulationNode::diagnose);
    control_timer_ = every(1.0 / params_.control_rate, "control", [this] { control(); });
    camera_thread_ = std::thread(&SimulationNode::runCamera, this);
    ROS_INFO_STREAM("world '" << world_.name << "', start '" << params_.start << "'");
  }

  ~SimulationNode()
  {
    running_ = false;
    camera_thread_.join();
  }

private:
  using Clock = std::chrono::steady_clock;
  using Command = typename Interface::Command;

  /** How long a command holds [s]. With a cycle of control and the time to brake the robot stands within 0.25 s. */
  static constexpr double COMMAND_TIMEOUT = 0.2;

  /** Simulates the robot up to the present time. The caller holds the robot's mutex. */
  void advance()
  {
    constexpr double MAX_STEP = 0.005;  // [s]
    if (commanded_ && secondsSince(last_command_) > COMMAND_TIMEOUT)
    {
      robot_->halt();
      commanded_ = false;
      ROS_WARN_STREAM_THROTTLE(10.0, "no command on " << command_subscriber_.getTopic() << " for " << COMMAND_TIMEOUT
                                                      << " s: the robot stands");
    }
    const double elapsed = secondsSince(last_step_);
    last_step_ = Clock::now();
    const int steps = static_cast<int>(std::ceil(elapsed / MAX_STEP));
    for (int i = 0; i < steps; ++i)
    {
      robot_->step(elapsed / steps);
    }
  }

  void control()
  {
    const std::lock_guard<std::mutex> lock(robot_mutex_);
    advance();
    interface_->publish(*robot_, ros::Time::now());
  }

  void command(const typename Command::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(robot_mutex_);
    advance();
    const auto twist = interface_->toTwist(*message);
    if (!twist || !robot_->command(*twist))
    {
      ROS_ERROR_STREAM_THROTTLE(
          1.0, "refused a command on " << command_subscriber_.getTopic() << ": not finite, or in another frame");
      return;
    }
    last_command_ = Clock::now();
    commanded_ = true;
  }

  void setPose(const SetPose::Request& request, SetPose::Response& response)
  {
    const std::lock_guard<std::mutex> lock(robot_mutex_);
    robot_->setPose(toIsometry(request.pose));
    advance();
    response.success = true;
    response.message = "moved";
  }

  void setLight(const SetLight::Request& request, SetLight::Response& response)
  {
    if (!(request.gain > 0.0 && std::isfinite(request.gain)) || !std::isfinite(request.offset) ||
        !(std::abs(request.gradient) < 2.0))
    {
      throw std::invalid_argument("the gain must be positive, the offset finite, the gradient within (-2, 2)");
    }
    const std::lock_guard<std::mutex> lock(camera_mutex_);
    camera_->setLight({ request.gain, request.offset, request.gradient });
    response.success = true;
    response.message = "lit";
  }

  void runCamera()
  {
    ros::WallRate rate(world_.camera_rate);
    while (running_ && ros::ok())
    {
      guarded("the camera", [this] { takeImage(); });
      rate.sleep();
    }
  }

  void takeImage()
  {
    constexpr int EXPOSED = 5;  // poses spread over the exposure; the stamp is that of its middle
    std::vector<Eigen::Isometry3d> poses;
    ros::Time stamp;
    {
      const std::lock_guard<std::mutex> lock(robot_mutex_);
      advance();
      stamp = ros::Time::now();
      const Waypoint now{ stamp.toSec(), robot_->cameraPose() };
      poses.push_back(now.pose);
      const double exposure = world_.quality.exposure;
      if (exposure > 0.0 && !last_view_.empty() && last_view_.front().time < now.time)
      {
        const std::vector<Waypoint> way = { last_view_.front(), now };
        poses.clear();
        for (int i = 0; i < EXPOSED; ++i)
        {
          poses.push_back(poseAt(way, now.time - exposure * i / (EXPOSED - 1)));
        }
        stamp -= ros::Duration(0.5 * exposure);
      }
      last_view_ = { now };
    }
    using sensor_msgs::image_encodings::MONO8;
    using sensor_msgs::image_encodings::RGB8;
    sensor_msgs::CameraInfo info = toCameraInfo(world_, params_.focal_length_error, stamp);
    info.header.frame_id = FrameNames(params_.frame_prefix)(info.header.frame_id);
    if (image_publisher_.getNumSubscribers() > 0)
    {
      cv::Mat image;
      {
        const std::lock_guard<std::mutex> lock(camera_mutex_);
        image = camera_->capture(poses);
      }
      if (params_.colour)
      {
        cv::cvtColor(image, image, cv::COLOR_GRAY2RGB);
      }
      image_publisher_.publish(toImage(image, params_.colour ? RGB8 : MONO8, info.header), info);
    }
    ground_truth_publisher_.publish(toGroundTruth(poses[poses.size() / 2], stamp));
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(robot_mutex_);
    Interface::diagnose(*robot_, status);
    status.add("world", world_.name);
  }

  SimulationParams params_;
  World world_;
  image_transport::ImageTransport images_;
  std::mutex camera_mutex_;
  std::unique_ptr<SimulatedCamera> camera_;
  std::mutex robot_mutex_;
  std::unique_ptr<typename Interface::Robot> robot_;
  std::unique_ptr<Interface> interface_;
  Clock::time_point last_step_;
  Clock::time_point last_command_;
  bool commanded_ = false;
  std::vector<Waypoint> last_view_;  // the camera's pose at the last image, alone; empty before the first
  std::atomic<bool> running_{ true };
  image_transport::CameraPublisher image_publisher_;
  ros::Publisher ground_truth_publisher_;
  ros::Subscriber command_subscriber_;
  ros::ServiceServer set_pose_service_;
  ros::ServiceServer set_light_service_;
  ros::SteadyTimer control_timer_;
  std::thread camera_thread_;
};

}  // namespace view_servo::sim
