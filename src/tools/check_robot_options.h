// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check_ros/setup.h"
#include "check_ros/test_drive.h"

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** What the user of check_robot wants. */
struct CheckOptions
{
  check::Setup setup;
  check::DriveParams drive;
  double seconds = 10.0;                    ///< how long to listen [s]
  bool move = false;                        ///< move the robot a little afterwards
  bool yes = false;                         ///< drive without asking
  bool json = false;                        ///< print one JSON object instead of lines
  bool no_picture = false;                  ///< write no picture
  std::string picture = "check_robot.png";  ///< file to write the camera's picture to, unless `no_picture`
  std::vector<std::string> for_ros;         ///< arguments for ros::init()
};

/**
 * Reads the command line: options, `homing` or `arm_servo`, and arguments NAME:=VALUE as the launch file of that name
 * takes them. Those that do not matter here are passed over. @return nothing when help was asked for, and has been
 * printed.
 * @throws std::runtime_error naming what is wrong, in one line.
 */
std::optional<CheckOptions> readCheckOptions(int argc, char** argv);

}  // namespace view_servo
