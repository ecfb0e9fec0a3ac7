// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/ros/readiness.h"

#include <functional>
#include <string>
#include <vector>

namespace view_servo
{
/** The parameters of a run; the defaults are those of the arm. */
struct RunParams
{
  std::string world = "rice";        ///< a world's file, or the name of one in config/worlds/
  std::string start = "near";        ///< where the robot begins, as the program describes it
  std::string view = "demo";         ///< the name that the view is stored by
  bool arm = true;                   ///< false: of a base, which has no approach
  std::string approach;              ///< a start at which another view is stored, on the way; empty: none
  double timeout = 60.0;             ///< of the goal [s]
  double patience = START_PATIENCE;  ///< longest wait for another node [s]
  std::string result;                ///< the file that the outcome is written to; empty: none
  bool exit = true;                  ///< the program ends after the run, and roslaunch with it
  std::function<void(const std::string&)> give_up;  ///< ends the process as a failed run, for the reason given
};

/** The defaults of the base. */
inline RunParams homingRunParams()
{
  RunParams params;
  params.arm = false;
  params.world = "desk";
  params.start = "thesis";
  params.timeout = 120.0;
  return params;
}

/** The defaults of a base on a route. */
inline RunParams routeRunParams()
{
  RunParams params = homingRunParams();
  params.start = "-2 0";
  params.timeout = 300.0;
  return params;
}

/** Names, units, ranges and meanings of those that are read. */
inline std::vector<Parameter> parameters(RunParams& params)
{
  std::vector<Parameter> table = {
    text("world", params.world, "a world's file, or the name of one in config/worlds/"),
    text("start", params.start,
         "where the robot starts, one of the world's starts; for a base also \"x y yaw\" [m, m, rad]"),
    text("view", params.view, "name under which the view, or the route, is stored"),
    real("timeout", params.timeout, "s", "> 0", "time limit of the goal"),
    real("patience", params.patience, "s", "> 0", "longest wait for another node"),
    text("result", params.result, "file that the outcome is written to; empty: none"),
    boolean("exit", params.exit, "whether the program ends after the run, and roslaunch with it"),
  };
  if (params.arm)
  {
    table.push_back(
        text("approach", params.approach,
             "one of the world's starts: a view is stored there, too, to which the arm goes first; empty: none"));
  }
  return table;
}

}  // namespace view_servo
