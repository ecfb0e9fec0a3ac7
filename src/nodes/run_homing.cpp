// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/robot_messages.h"
#include "sim/world.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetPose.h"
#include "view_servo/geometry/planar_motion.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/package.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <ros/subscriber.h>
#include <std_srvs/SetBool.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
constexpr double PATIENCE = 60.0;  // for other nodes [s]

/** "x y yaw" [m, m, rad] in the world, or the name of one of its starts; yaw may be left out. */
Eigen::Isometry3d parseStart(const sim::World& world, const std::string& text)
{
  std::istringstream stream(text);
  double x = 0.0;
  double y = 0.0;
  double yaw = 0.0;
  if (!(stream >> x >> y))
  {
    return world.start(text);
  }
  if (!(stream >> yaw) && !stream.eof())
  {
    throw std::invalid_argument("start: '" + text + "' is neither \"x y yaw\" nor a start's name");
  }
  return sim::planarPose(x, y, yaw);
}

/**
 * A run of homing in simulation: stores the view at the world's goal, puts the base at a start, homes, and says how far
 * off it ends.
 */
class HomingRun
{
public:
  HomingRun(ros::NodeHandle& nh, const sim::World& world) : nh_(nh), world_(world), home_(nh, "home", true)
  {
    truth_subscriber_ = nh.subscribe("ground_truth", 5, &HomingRun::takeTruth, this);
  }

  /** @return whether homing says that it has arrived; `summary` says it in a line. */
  bool run(const std::string& view, const Eigen::Isometry3d& start, double timeout, std::string& summary)
  {
    for (const char* service : { "nomad_sim/set_pose", "view_store/save", "homing/enable" })
    {
      if (!ros::service::waitForService(nh_.resolveName(service), ros::Duration(PATIENCE)))
      {
        throw std::runtime_error("there is no service " + nh_.resolveName(service));
      }
    }
    const geometry_msgs::Pose goal = moveTo(world_.goal);
    SaveView save;
    save.request.name = view;
    save.request.overwrite = 1;
    call("view_store/save", save);
    moveTo(start);
    std_srvs::SetBool enable;
    enable.request.data = 1;
    call("homing/enable", enable);
    if (!home_.waitForServer(ros::Duration(PATIENCE)))
    {
      throw std::runtime_error("there is no action server " + nh_.resolveName("home"));
    }
    HomeToViewGoal order;
    order.view = view;
    order.timeout = timeout;
    home_.sendGoal(order);
    home_.waitForResult();
    const HomeToViewResult result = *home_.getResult();

    const PlanarPose off = compose(inverse(planar(goal)), planar(rest()));
    const bool success = result.success != 0;
    char text[200];
    std::snprintf(text, sizeof(text),
                  "the base is %.1f mm and %.2f degrees from where the view was stored (%.1f mm ahead, %.1f mm to the "
                  "left), after %.2f m in %.1f s",
                  1e3 * off.distance(), off.yaw * 180.0 / M_PI, 1e3 * off.x, 1e3 * off.y, result.travelled,
                  result.duration);
    summary = std::string(success ? "arrived" : "not arrived") + " (" + result.message + "): " + text;
    return success;
  }

private:
  /** The camera's pose, of its optical frame, on the floor: x along its axis. */
  static PlanarPose planar(const geometry_msgs::Pose& camera)
  {
    const Eigen::Isometry3d pose = sim::toIsometry(camera);
    const Eigen::Vector3d axis = pose.linear().col(2);
    return { pose.translation().x(), pose.translation().y(), std::atan2(axis.y(), axis.x()) };
  }

  void takeTruth(const geometry_msgs::PoseStamped::ConstPtr& message)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      previous_ = truth_;
      truth_ = *message;
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

  /** Moves the base, and waits until images show it there. @return the camera's pose. */
  geometry_msgs::Pose moveTo(const Eigen::Isometry3d& base)
  {
    SetPose move;
    move.request.pose = sim::toPose(base);
    call("nomad_sim/set_pose", move);
    const PlanarPose wanted = toPlanar(base * world_.camera_on_base * planarFromOptical());
    return waitFor("an image from where the base was put",
                   [&wanted](const geometry_msgs::Pose& before, const geometry_msgs::Pose& now) {
                     return compose(inverse(wanted), planar(before)).distance() < 1e-3 &&
                            compose(inverse(wanted), planar(now)).distance() < 1e-3;
                   });
  }

  /** Optical axes to those of a base that looks along them. */
  static Eigen::Isometry3d planarFromOptical()
  {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0;
    return pose;
  }

  /** The camera's pose when the base stands. */
  geometry_msgs::Pose rest()
  {
    return waitFor("the base to stand", [](const geometry_msgs::Pose& before, const geometry_msgs::Pose& now) {
      return compose(inverse(planar(before)), planar(now)).distance() < 1e-6;
    });
  }

  geometry_msgs::Pose waitFor(const std::string& what,
                              const std::function<bool(const geometry_msgs::Pose&, const geometry_msgs::Pose&)>& holds)
  {
    std::unique_lock<std::mutex> lock(mutex_);
    const int first = truths_;
    const bool reached = arrived_.wait_for(lock, std::chrono::duration<double>(PATIENCE),
                                           [&] { return truths_ >= first + 2 && holds(previous_.pose, truth_.pose); });
    if (!reached)
    {
      throw std::runtime_error("waited in vain for " + what);
    }
    return truth_.pose;
  }

  ros::NodeHandle& nh_;
  const sim::World& world_;
  actionlib::SimpleActionClient<HomeToViewAction> home_;
  ros::Subscriber truth_subscriber_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  geometry_msgs::PoseStamped previous_;
  geometry_msgs::PoseStamped truth_;
  int truths_ = 0;
};

}  // namespace
}  // namespace view_servo

/**
 * Runs homing once in simulation: see HomingRun. Parameters, all private:
 *  - `~world` (string, default "desk"), `~start` (string, default "thesis"): "x y yaw" [m, m, rad], or a start's name;
 *  - `~view` (string, default "demo"): the name that the view is stored by;
 *  - `~timeout` (double, default 120 [s]);
 *  - `~result` (string, default ""): file that the outcome is written to, in a line;
 *  - `~exit` (bool, default true): end afterwards, with status 0 when the base has arrived and 1 when not.
 */
int main(int argc, char** argv)
{
  ros::init(argc, argv, "run_homing");
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  bool success = false;
  bool exit = true;
  std::string summary;
  std::string result_file;
  try
  {
    std::string world_name = "desk";
    std::string start = "thesis";
    std::string view = "demo";
    double timeout = 120.0;
    view_servo::ParameterReader reader(ros::NodeHandle("~"));
    reader.read("world", world_name);
    reader.read("start", start);
    reader.read("view", view);
    reader.read("timeout", timeout);
    reader.read("result", result_file);
    reader.read("exit", exit);
    reader.finish();
    const view_servo::sim::World world =
        view_servo::sim::findWorld(world_name, ros::package::getPath("view_servo") + "/config/worlds");
    view_servo::HomingRun run(nh, world);
    success = run.run(view, view_servo::parseStart(world, start), timeout, summary);
  }
  catch (const std::exception& error)
  {
    summary = "failed: " + view_servo::oneLine(error);
  }
  std::cout << "homing: " << summary << std::endl;
  if (!result_file.empty())
  {
    std::ofstream(result_file) << (success ? 0 : 1) << ' ' << summary << '\n';
  }
  if (!exit)
  {
    ros::waitForShutdown();
  }
  return success ? 0 : 1;
}
