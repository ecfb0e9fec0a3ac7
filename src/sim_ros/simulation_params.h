// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world_reader.h"
#include "view_servo/parameters/parameter.h"

#include <ros/package.h>

#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** The parameters that the nodes of all simulated robots have; parameters(SimulationParams&) says what each means. */
struct SimulationParams
{
  std::string world = "desk";
  std::string start;
  std::string groups;
  std::uint64_t seed = 1;
  double image_noise = -1.0;
  double focal_length_error = 0.0;
  double control_rate = 50.0;
  std::string frame_prefix;
  bool colour = false;

  /**
   * Reads the world, and gives its camera the noise asked for. @throws std::invalid_argument when it is for another
   * robot.
   */
  World load(RobotKind robot) const
  {
    const World result = findWorld(world, ros::package::getPath("view_servo") + "/config/worlds");
    if (result.robot != robot)
    {
      throw std::invalid_argument("world '" + result.name + "' is for another robot");
    }
    return withImageNoise(result, image_noise);
  }

  /** The names in `groups`, which are separated by commas. */
  std::vector<std::string> groupNames() const
  {
    std::vector<std::string> names;
    std::istringstream stream(groups);
    for (std::string name; std::getline(stream, name, ',');)
    {
      names.push_back(name);
    }
    return names;
  }
};

/** Names, units, ranges and meanings of these parameters. */
inline std::vector<Parameter> parameters(SimulationParams& params)
{
  return {
    text("world", params.world, "a world's file, or the name of one in config/worlds/"),
    text("start", params.start, "where to begin, one of the world's starts; empty: its goal"),
    text("groups", params.groups, "groups of surfaces to show, separated by commas"),
    natural("seed", params.seed, "of all noise"),
    real("image_noise", params.image_noise, "grey levels", "", "standard deviation; negative: the world's"),
    real("focal_length_error", params.focal_length_error, "", "(-0.5, 0.5)",
         "part by which the focal lengths in camera_info are too long"),
    real("control_rate", params.control_rate, "Hz", "[10, 1000]",
         "rate at which the robot moves and publishes its state"),
    text("frame_prefix", params.frame_prefix,
         "put before the names of the robot's frames, with a slash between, so that several robots share one /tf; "
         "its launch file tells robot_state_publisher, too"),
    choice<bool>("encoding", params.colour, { { "mono8", false }, { "rgb8", true } },
                 "of images; those in colour show greys, too"),
  };
}

}  // namespace view_servo::sim
