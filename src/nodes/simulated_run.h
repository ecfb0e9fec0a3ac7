// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nodes/robot_messages.h"
#include "sim/world.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetPose.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/package.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <ros/subscriber.h>
#include <std_srvs/SetBool.h>
#include <Eigen/Geometry>

#include <chrono>
#include <condition_variable>
#include <fstream>
#include <functional>
#include <iostream>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/**
 * What runs of simulated robots share: the view is stored at the world's goal, the robot goes to a start, and the action that
 * brings it back is called; how far off it ends is measured by the ground truth.
 */
template <typename Action>
class SimulatedRun
{
public:
  /** @param robot simulation, and @param controller its servo, by node names; @param action the controller's. */
  SimulatedRun(ros::NodeHandle& nh, const std::string& robot, const std::string& controller, const std::string& action)
    : nh_(nh), robot_(robot), controller_(controller), action_name_(action), client_(nh, action, true)
  {
    truth_subscriber_ = nh.subscribe("ground_truth", 5, &SimulatedRun::takeTruth, this);
  }

  /** Waits for what a run calls. @throws std::runtime_error naming what does not come. */
  void waitForServices(const std::vector<std::string>& others)
  {
    std::vector<std::string> services = { robot_ + "/set_pose", "view_store/save", controller_ + "/enable" };
    services.insert(services.end(), others.begin(), others.end());
    for (const std::string& service : services)
    {
      if (!ros::service::waitForService(nh_.resolveName(service), ros::Duration(PATIENCE)))
      {
        throw std::runtime_error("there is no service " + nh_.resolveName(service));
      }
    }
  }

  /**
   * Moves the robot, and waits until images show it there.
   * @param pose as SetPose takes it. @param camera where the camera is then. @return where it is.
   */
  Eigen::Isometry3d moveTo(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& camera)
  {
    constexpr double NEAR = 1e-3;  // [m], [rad]
    SetPose move;
    move.request.pose = sim::toPose(pose);
    call(robot_ + "/set_pose", move);
    return waitFor("an image from where the robot was put",
                   [&camera](const Eigen::Isometry3d& before, const Eigen::Isometry3d& now) {
                     return isNear(camera, before, NEAR) && isNear(camera, now, NEAR);
                   });
  }

  /** The camera's pose when the robot stands. */
  Eigen::Isometry3d rest()
  {
    constexpr double STILL = 1e-6;  // [m], [rad]
    return waitFor("the robot to stand", [](const Eigen::Isometry3d& before, const Eigen::Isometry3d& now) {
      return isNear(before, now, STILL);
    });
  }

  /** Stores what the camera sees. */
  void save(const std::string& view, const cv::Rect& region)
  {
    SaveView service;
    service.request.name = view;
    service.request.roi = toRegionOfInterest(region);
    service.request.overwrite = 1;
    call("view_store/save", service);
  }

  /** Enables the controller, sends it the goal and waits for the end. */
  typename Action::_action_result_type::_result_type drive(const typename Action::_action_goal_type::_goal_type& goal)
  {
    std_srvs::SetBool enable;
    enable.request.data = 1;
    call(controller_ + "/enable", enable);
    if (!client_.waitForServer(ros::Duration(PATIENCE)))
    {
      throw std::runtime_error("there is no action server " + nh_.resolveName(action_name_));
    }
    client_.sendGoal(goal);
    client_.waitForResult();
    const auto result = client_.getResult();
    if (!result)
    {
      throw std::runtime_error(nh_.resolveName(action_name_) + " ended without a result");
    }
    return *result;
  }

private:
  static constexpr double PATIENCE = 60.0;  // for other nodes [s]

  static bool isNear(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double tolerance)
  {
    return (a.translation() - b.translation()).norm() < tolerance && (a.linear() - b.linear()).norm() < 2.0 * tolerance;
  }

  void takeTruth(const geometry_msgs::PoseStamped::ConstPtr& message)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      previous_ = truth_;
      truth_ = sim::toIsometry(message->pose);
      ++truths_;
    }
    arrived_.notify_all();
  }

  template <typename Service>
  void call(const std::string& name, Service& service)
  {
    if (!ros::service::call(nh_.resolveName(name), service) || service.response.success == 0)
    {
      throw std::runtime_error(nh_.resolveName(name) + ": " + service.response.message);
    }
  }

  Eigen::Isometry3d waitFor(const std::string& what,
                            const std::function<bool(const Eigen::Isometry3d&, const Eigen::Isometry3d&)>& holds)
  {
    std::unique_lock<std::mutex> lock(mutex_);
    const int first = truths_;
    const bool reached = arrived_.wait_for(lock, std::chrono::duration<double>(PATIENCE),
                                           [&] { return truths_ >= first + 2 && holds(previous_, truth_); });
    if (!reached)
    {
      throw std::runtime_error("waited in vain for " + what);
    }
    return truth_;
  }

  ros::NodeHandle& nh_;
  const std::string robot_;
  const std::string controller_;
  const std::string action_name_;
  actionlib::SimpleActionClient<Action> client_;
  ros::Subscriber truth_subscriber_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable arrived_;
  Eigen::Isometry3d previous_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d truth_ = Eigen::Isometry3d::Identity();
  int truths_ = 0;
};

/** What comes of a run. */
struct RunOutcome
{
  bool success = false;
  std::string summary;  ///< one line
};

/** What runs can be told. */
struct RunParams
{
  std::string world;
  std::string start;
  std::string view = "demo";
  double timeout;
};

/**
 * main() of a program that runs a simulated robot once. Parameters, all private:
 *  - `~world`, `~start` (string), `~timeout` (double [s]), with the program's defaults;
 *  - `~view` (string, default "demo"): the name that the view is stored by;
 *  - `~result` (string, default ""): file that the outcome is written to, 0 or 1 and a line;
 *  - `~exit` (bool, default true): end afterwards, with status 0 when the robot is at the view and 1 when not.
 *
 * @param what of the run, for the line that is printed.
 * @param run does it; what it throws is the outcome, too.
 */
inline int runSimulation(int argc, char** argv, const std::string& name, const std::string& what, RunParams params,
                         const std::function<RunOutcome(ros::NodeHandle&, const sim::World&, const RunParams&)>& run)
{
  ros::init(argc, argv, name);
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  bool exit = true;
  std::string result_file;
  RunOutcome outcome;
  try
  {
    ParameterReader reader(ros::NodeHandle("~"));
    reader.read("world", params.world);
    reader.read("start", params.start);
    reader.read("view", params.view);
    reader.read("timeout", params.timeout);
    reader.read("result", result_file);
    reader.read("exit", exit);
    reader.finish();
    outcome = run(nh, sim::findWorld(params.world, ros::package::getPath("view_servo") + "/config/worlds"), params);
  }
  catch (const std::exception& error)
  {
    outcome = { false, "failed: " + oneLine(error) };
  }
  std::cout << what << ": " << outcome.summary << std::endl;
  if (!result_file.empty())
  {
    std::ofstream(result_file) << (outcome.success ? 0 : 1) << ' ' << outcome.summary << '\n';
  }
  if (!exit)
  {
    ros::waitForShutdown();
  }
  return outcome.success ? 0 : 1;
}

}  // namespace view_servo
