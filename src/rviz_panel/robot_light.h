// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rviz_panel/robot_snapshot.h"

#include <string>

namespace view_servo
{
/** The traffic light of a robot, with its reason. */
struct RobotLight
{
  enum Colour
  {
    GREY,   ///< nothing drives here
    GREEN,  ///< it drives, has arrived, or waits for a goal
    AMBER,  ///< its gate is closed, or it looks for the view
    RED     ///< it ended short of the view, reports an error, or is silent
  };
  Colour colour = GREY;
  std::string text;
  bool dry_run = false;  ///< nothing moves, whatever it says
};

/** Of the drivers that are there, the one in the worst state. */
RobotLight judgeRobot(const RobotSnapshot& robot);

}  // namespace view_servo
