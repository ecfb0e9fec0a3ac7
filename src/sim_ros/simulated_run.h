// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world_reader.h"
#include "sim_ros/command_listeners.h"
#include "sim_ros/robot_messages.h"
#include "sim_ros/run_command_line.h"
#include "sim_ros/run_params.h"
#include "view_servo/SaveView.h"
#include "view_servo/ServoStatus.h"
#include "view_servo/SetPose.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/readiness.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/package.h>
#include <ros/spinner.h>
#include <ros/subscriber.h>
#include <sensor_msgs/Image.h>
#include <std_srvs/SetBool.h>
#include <Eigen/Geometry>

#include <unistd.h>
#include <csignal>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
/**
 * The steps of a run of a simulated robot, which are the same for both robots: the view is stored at the world's goal,
 * the robot is put at a start, and the action that brings it back is called. How far off it ends is measured by the
 * ground truth. All waits are by a steady clock and end after `RunParams::patience`; the exception then says what was
 * waited for.
 */
template <typename Action>
class SimulatedRun
{
public:
  /** @param robot node of the simulation. @param controller node that drives it. @param action of the controller. */
  SimulatedRun(ros::NodeHandle& nh, const RunParams& params, const std::string& robot, const std::string& controller,
               const std::string& action)
    : nh_(nh), params_(params), robot_(robot), controller_(controller), action_name_(action), client_(nh, action, true)
  {
    truth_subscriber_ = nh.subscribe("ground_truth", 5, &SimulatedRun::takeTruth, this);
    status_subscriber_ = nh.subscribe("status", 5, &SimulatedRun::takeStatus, this);
  }

  /**
   * Waits for everything that a run needs: the ground truth and images arrive, services and the action are offered.
   * Nobody else may listen to the commands then, see foreignListener().
   * @param others services to wait for besides those that every run calls.
   * @throws std::runtime_error naming what is missing, or who listens.
   */
  void waitForOthers(const std::vector<std::string>& others)
  {
    std::atomic<bool> image_came(false);
    const boost::function<void(const sensor_msgs::Image::ConstPtr&)> take_image =
        [&image_came](const sensor_msgs::Image::ConstPtr&) {
          image_came = true;
        };
    ros::Subscriber images = nh_.subscribe<sensor_msgs::Image>("camera/image_raw", 1, take_image);
    std::vector<std::string> services = { robot_ + "/set_pose", "view_store/save", controller_ + "/enable" };
    services.insert(services.end(), others.begin(), others.end());
    const auto missing = [&]() -> std::string {
      if (truths() == 0)
      {
        return nothingCameOn(truth_subscriber_);
      }
      if (!image_came)
      {
        return nothingCameOn(images);
      }
      while (!services.empty())  // what was there once needs no second look
      {
        const std::string service = nh_.resolveName(services.back());
        if (!ros::service::exists(service, false))
        {
          return "there is no service " + service;
        }
        services.pop_back();
      }
      return client_.isServerConnected() ? "" : "there is no action server " + nh_.resolveName(action_name_);
    };
    const std::string why = waitUntilReady(params_.patience, missing);
    images.shutdown();
    require(why);
    const std::string foreign =
        foreignListener(nh_.resolveName("cmd_vel"), nh_.resolveName(action_name_), nh_.resolveName(robot_));
    if (!foreign.empty())
    {
      throw std::runtime_error(foreign);
    }
  }

  /**
   * Moves the robot, and waits until images show it there.
   * @param pose as SetPose takes it. @param camera world from the camera, as it should be then.
   * @return world from the camera, as it is.
   */
  Eigen::Isometry3d moveTo(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& camera)
  {
    constexpr double NEAR = 1e-3;  // [m], [rad]
    SetPose move;
    move.request.pose = sim::toPose(pose);
    call(robot_ + "/set_pose", move);
    return waitFor("no image has come from where the robot was put",
                   [&camera](const Eigen::Isometry3d& before, const Eigen::Isometry3d& now) {
                     return isNear(camera, before, NEAR) && isNear(camera, now, NEAR);
                   });
  }

  /** Waits until the robot stands still. @return world from the camera. */
  Eigen::Isometry3d rest()
  {
    constexpr double STILL = 1e-6;  // [m], [rad]
    return waitFor("the robot does not stand still", [](const Eigen::Isometry3d& before, const Eigen::Isometry3d& now) {
      return isNear(before, now, STILL);
    });
  }

  /** Stores what the camera sees as a view. @param region of interest [px]; empty: the whole image. */
  void save(const std::string& view, const cv::Rect& region)
  {
    SaveView service;
    service.request.name = view;
    service.request.roi = toRegionOfInterest(region);
    service.request.overwrite = 1;
    call("view_store/save", service);
  }

  /**
   * Enables the controller, sends it a goal and waits until that has ended.
   * @throws std::runtime_error when it does not end in time, or its server vanishes; the goal is then cancelled.
   */
  typename Action::_action_result_type::_result_type drive(const typename Action::_action_goal_type::_goal_type& goal)
  {
    std_srvs::SetBool enable;
    enable.request.data = 1;
    call(controller_ + "/enable", enable);
    client_.sendGoal(goal);
    const std::string missing = waitForEnd();
    if (!missing.empty())
    {
      client_.cancelGoal();
      throw std::runtime_error(missing + "; its status said last: " + lastStatus());
    }
    const auto result = client_.getResult();
    if (!result)
    {
      throw std::runtime_error(nh_.resolveName(action_name_) + " ended without a result, as " +
                               client_.getState().toString());
    }
    return *result;
  }

  /**
   * Calls a service. roscpp gives its calls no deadline, and one whose other side hangs or resets the connection may
   * never return. So the call is made by a thread of its own that shares nothing with this object; when it takes too
   * long the whole process ends, without destroying anything that the thread may still use.
   * @throws std::runtime_error when the answer is no.
   */
  template <typename Service>
  void call(const std::string& name, Service& service)
  {
    struct Call
    {
      Service service;
      std::atomic<bool> has_ended = { false };
      bool was_answered = false;  // valid once it has ended
    };
    const std::string resolved = nh_.resolveName(name);
    const std::shared_ptr<Call> shared = std::make_shared<Call>();
    shared->service = service;
    std::thread([shared, resolved] {
      guarded("calling " + resolved, [&] { shared->was_answered = callService(resolved, shared->service); });
      shared->has_ended = true;
    }).detach();
    const std::string missing = waitUntilReady(params_.patience, [&]() -> std::string {
      return shared->has_ended ? "" : "there is no answer of the service " + resolved;
    });
    if (!missing.empty())
    {
      params_.give_up(ros::ok() ? "waited in vain: " + missing : "interrupted");
    }
    service = shared->service;
    if (!shared->was_answered || service.response.success == 0)
    {
      throw std::runtime_error(resolved + ": " + (shared->was_answered ? service.response.message : "the call failed"));
    }
  }

private:
  using Clock = std::chrono::steady_clock;

  static bool isNear(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double tolerance)
  {
    return (a.translation() - b.translation()).norm() < tolerance && (a.linear() - b.linear()).norm() < 2.0 * tolerance;
  }

  static std::string nothingCameOn(const ros::Subscriber& subscriber)
  {
    return (subscriber.getNumPublishers() == 0 ? "nobody publishes on " : "nothing has come on ") +
           subscriber.getTopic();
  }

  /** @throws std::runtime_error with what is missing, unless that is nothing. */
  static void require(const std::string& missing)
  {
    if (!ros::ok())
    {
      throw std::runtime_error("interrupted");
    }
    if (!missing.empty())
    {
      throw std::runtime_error("waited in vain: " + missing);
    }
  }

  /** Takes the camera's true pose. */
  void takeTruth(const geometry_msgs::PoseStamped::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    previous_ = truth_;
    truth_ = sim::toIsometry(message->pose);
    ++truths_;
  }

  void takeStatus(const ServoStatus::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_ = message->reason;
  }

  /** Number of true poses that have come. */
  int truths() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return truths_;
  }

  std::string lastStatus() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return status_.empty() ? "nothing" : "'" + status_ + "'";
  }

  /** Waits until the goal has ended. @return why it has not; empty when it has. */
  std::string waitForEnd()
  {
    constexpr std::chrono::milliseconds POLL(10);
    constexpr std::chrono::seconds ABSENCE(5);  // of the server; a connection may come back
    const double longest = params_.timeout + params_.patience;
    const auto deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(longest));
    const std::string action = nh_.resolveName(action_name_);
    Clock::time_point last_seen = Clock::now();
    while (!client_.getState().isDone())
    {
      const Clock::time_point now = Clock::now();
      last_seen = client_.isServerConnected() ? now : last_seen;
      if (!ros::ok())
      {
        return "interrupted while driving";
      }
      if (now - last_seen > ABSENCE)
      {
        return "the action server " + action + " has vanished";
      }
      if (now > deadline)
      {
        return "the goal of " + action + " did not end within " + seconds(longest);
      }
      std::this_thread::sleep_for(POLL);
    }
    return "";
  }

  /**
   * Waits until a condition holds for the last two true poses of the camera, both of which came after the call, and
   * returns the last one. @param what to say when it does not hold in time.
   */
  Eigen::Isometry3d waitFor(const std::string& what,
                            const std::function<bool(const Eigen::Isometry3d&, const Eigen::Isometry3d&)>& holds)
  {
    const int first = truths();
    Eigen::Isometry3d reached = Eigen::Isometry3d::Identity();
    require(waitUntilReady(params_.patience, [&]() -> std::string {
      const std::lock_guard<std::mutex> lock(mutex_);
      reached = truth_;
      return truths_ >= first + 2 && holds(previous_, truth_) ? "" : what;
    }));
    return reached;
  }

  ros::NodeHandle& nh_;
  const RunParams& params_;
  const std::string robot_;       // node of the simulation
  const std::string controller_;  // node that drives it
  const std::string action_name_;
  mutable std::mutex mutex_;                                    // guards what follows, up to the client
  Eigen::Isometry3d previous_ = Eigen::Isometry3d::Identity();  // the true pose before truth_
  Eigen::Isometry3d truth_ = Eigen::Isometry3d::Identity();     // the newest true pose: world from camera
  int truths_ = 0;                                              // number of true poses that have come
  std::string status_;                                          // reason of the driver's last status
  actionlib::SimpleActionClient<Action> client_;
  ros::Subscriber truth_subscriber_;
  ros::Subscriber status_subscriber_;
};

/** How a run ended. */
struct RunOutcome
{
  bool success = false;
  std::string summary;  ///< one line
};

/** Whether a process is roslaunch: started by its name, or as a script that an interpreter runs. */
inline bool isRoslaunch(pid_t process)
{
  std::ifstream file("/proc/" + std::to_string(process) + "/cmdline");
  std::string argument;
  for (int i = 0; i < 3 && std::getline(file, argument, '\0'); ++i)
  {
    if (argument.substr(argument.rfind('/') + 1) == "roslaunch")
    {
      return true;
    }
  }
  return false;
}

/**
 * Ends roslaunch, when that has started this process, as Ctrl-C does; roslaunch then ends this process and the others.
 * If this process ended first instead, roslaunch would report in red that a required process has died, as after a
 * crash.
 */
inline void endWithRoslaunch()
{
  constexpr double LONGEST = 20.0;  // until roslaunch ends this process [s]
  const pid_t parent = getppid();
  if (ros::ok() && isRoslaunch(parent) && kill(parent, SIGINT) == 0)
  {
    waitUntilReady(LONGEST, [] { return std::string("roslaunch does not end"); });
  }
}

/**
 * main() of a program that runs a simulated robot once. Its parameters, all private, are those of RunParams. With
 * `~exit` it ends afterwards, with status 0 when the robot is at the view and 1 when not, and roslaunch ends, too, when
 * that has started the program. --help, and a command line that is wrong, are answered without a master.
 *
 * @param params the defaults.
 * @param run does it; an exception counts as a failed run.
 */
inline int runSimulation(int argc, char** argv, const RunProgram& program, RunParams params,
                         const std::function<RunOutcome(ros::NodeHandle&, const sim::World&, const RunParams&)>& run)
{
  if (const std::optional<int> status = answerCommandLine(argc, argv, program, params))
  {
    return *status;
  }
  ros::init(argc, argv, program.name);
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  const auto end = [&](const RunOutcome& outcome) {
    (outcome.success ? std::cout : std::cerr) << program.what << ": " << outcome.summary << std::endl;
    if (!params.result.empty())
    {
      std::ofstream(params.result) << (outcome.success ? 0 : 1) << ' ' << outcome.summary << std::endl;
    }
    if (params.exit)
    {
      endWithRoslaunch();
    }
    else
    {
      ros::waitForShutdown();
    }
    return outcome.success ? 0 : 1;
  };
  params.give_up = [&](const std::string& why) {
    std::_Exit(end({ false, "failed: " + why }));
  };
  RunOutcome outcome;
  try
  {
    ParameterReader reader(ros::NodeHandle("~"));
    const std::vector<Parameter> table = parameters(params);
    reader.read(table);
    reader.addFaults(faultsOf(table));
    reader.finish();
    outcome = run(nh, sim::findWorld(params.world, ros::package::getPath("view_servo") + "/config/worlds"), params);
  }
  catch (const std::exception& error)
  {
    outcome = { false, "failed: " + oneLine(error) };
  }
  return end(outcome);
}

}  // namespace view_servo
