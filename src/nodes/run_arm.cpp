// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/simulated_run.h"
#include "view_servo/ServoToViewAction.h"

#include <cmath>
#include <cstdio>
#include <string>

namespace view_servo
{
namespace
{
RunOutcome run(ros::NodeHandle& nh, const sim::World& world, const RunParams& params)
{
  SimulatedRun<ServoToViewAction> simulation(nh, params, "puma_sim", "servo_25d", "servo");
  simulation.waitForOthers({ "homography_tracker/start" });
  const Eigen::Isometry3d start = world.start(params.start);
  const Eigen::Isometry3d goal = simulation.moveTo(world.goal, world.goal);
  simulation.save(params.view, world.region);
  simulation.moveTo(start, start);
  ServoToViewGoal order;
  order.view = params.view;
  order.timeout = params.timeout;
  const ServoToViewResult result = simulation.drive(order);
  const Eigen::Isometry3d off = goal.inverse() * simulation.rest();
  char text[200];
  std::snprintf(
      text, sizeof(text), "the camera is %.2f mm and %.3f degrees from where the view was stored, after %.1f s",
      1e3 * off.translation().norm(), Eigen::AngleAxisd(off.linear()).angle() * 180.0 / M_PI, result.duration);
  const bool success = result.success != 0;
  return { success, std::string(success ? "converged" : "not converged") + " (" + result.message + "): " + text };
}

}  // namespace
}  // namespace view_servo

/**
 * Runs 2.5D servoing once in simulation, and says how far off the camera ends. Parameters: see runSimulation(); `~start` is
 * one of the world's starts.
 */
int main(int argc, char** argv)
{
  return view_servo::runSimulation(argc, argv, "run_arm", "servo", {}, view_servo::run);
}
