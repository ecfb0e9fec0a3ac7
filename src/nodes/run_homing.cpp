// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/simulated_run.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/geometry/planar_pose.h"

#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
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

/** The pose on the floor of a camera: x along its axis. */
PlanarPose onFloor(const Eigen::Isometry3d& camera)
{
  const Eigen::Vector3d axis = camera.linear().col(2);
  return { camera.translation().x(), camera.translation().y(), std::atan2(axis.y(), axis.x()) };
}

RunOutcome run(ros::NodeHandle& nh, const sim::World& world, const RunParams& params)
{
  SimulatedRun<HomeToViewAction> simulation(nh, params, "nomad_sim", "homing", "home");
  simulation.waitForOthers({});
  const Eigen::Isometry3d start = parseStart(world, params.start);
  const Eigen::Isometry3d goal = simulation.moveTo(world.goal, world.goal * world.camera_on_base);
  simulation.save(params.view, cv::Rect());
  simulation.moveTo(start, start * world.camera_on_base);
  HomeToViewGoal order;
  order.view = params.view;
  order.timeout = params.timeout;
  const HomeToViewResult result = simulation.drive(order);
  const PlanarPose off = compose(inverse(onFloor(goal)), onFloor(simulation.rest()));
  char text[200];
  std::snprintf(text, sizeof(text),
                "the base is %.1f mm and %.2f degrees from where the view was stored (%.1f mm ahead, %.1f mm to the "
                "left), after %.2f m in %.1f s",
                1e3 * off.distance(), off.yaw * 180.0 / M_PI, 1e3 * off.x, 1e3 * off.y, result.travelled,
                result.duration);
  const bool success = result.success != 0;
  return { success, std::string(success ? "arrived" : "not arrived") + " (" + result.message + "): " + text };
}

}  // namespace
}  // namespace view_servo

/**
 * Runs homing once in simulation, and says how far off the base ends. Parameters: see runSimulation(); `~start` is
 * "x y yaw" [m, m, rad], or the name of one of the world's starts.
 */
int main(int argc, char** argv)
{
  return view_servo::runSimulation(argc, argv, "run_homing", "homing", view_servo::homingRunParams(), view_servo::run);
}
