// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/base_run.h"
#include "sim_ros/simulated_run.h"
#include "view_servo/HomeToViewAction.h"

#include <string>

namespace view_servo
{
namespace
{
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
  const std::string text = describeEnd(goal, simulation.rest(), result.travelled, result.duration);
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
  return view_servo::runSimulation(argc, argv,
                                   { "run_homing", "homing",
                                     "Runs homing of a mobile base once in simulation, with the nodes of "
                                     "homing.launch, and says how far off the base ends." },
                                   view_servo::homingRunParams(), view_servo::run);
}
