// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/visibility.h"
#include "sim_ros/simulated_run.h"
#include "view_servo/ServoToViewAction.h"

#include <cmath>
#include <cstdio>
#include <string>

namespace view_servo
{
namespace
{
constexpr double APPROACH_TRANSLATION = 0.01;  // of being at the approach view [m]
constexpr double APPROACH_ROTATION = 0.03;     // likewise [rad]

RunOutcome run(ros::NodeHandle& nh, const sim::World& world, const RunParams& params)
{
  SimulatedRun<ServoToViewAction> simulation(nh, params, "puma_sim", "servo_25d", "servo");
  simulation.waitForOthers({ "homography_tracker/start" });
  const Eigen::Isometry3d start = world.start(params.start);
  const Eigen::Isometry3d goal = simulation.moveTo(world.goal, world.goal);
  simulation.save(params.view, world.region);
  ServoToViewGoal order;
  if (params.approach.empty())
  {
    order.view = params.view;
  }
  else
  {
    const Eigen::Isometry3d& approach = world.start(params.approach);
    simulation.moveTo(approach, approach);
    order.views.resize(2);
    order.views.front().view = params.view + "_approach";
    order.views.front().translation_tolerance = APPROACH_TRANSLATION;
    order.views.front().rotation_tolerance = APPROACH_ROTATION;
    order.views.back().view = params.view;
    simulation.save(order.views.front().view, sim::regionSeenFrom(world, approach));
  }
  simulation.moveTo(start, start);
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
 * Runs 2.5D servoing once in simulation, and says how far off the camera ends. Parameters: see runSimulation();
 * `~start` is one of the world's starts. With `~approach` the goal is a list of two views.
 */
int main(int argc, char** argv)
{
  return view_servo::runSimulation(argc, argv,
                                   { "run_arm", "servo",
                                     "Runs 2.5D servoing of an arm once in simulation, with the nodes of "
                                     "arm_servo.launch, and says how far off the camera ends." },
                                   {}, view_servo::run);
}
