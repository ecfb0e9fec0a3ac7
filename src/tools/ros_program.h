// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/command_line.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file How command-line programs that use ROS begin. */

/**
 * As CommandLine::parse(), of the words that are not for ROS, such as "camera:=/front" or "__ns:=/robot1". Needs
 * neither ros::init() nor a master.
 */
std::optional<std::vector<std::string>> parseWithoutRosWords(CommandLine& line, int argc, char** argv);

/**
 * As ros::init(), for a program that writes nothing on standard error but one line when it fails: what ROS logs is not
 * printed, unless it is fatal. Several such programs may run at once. @param options besides that, of
 * ros::init_options::InitOption.
 */
void initQuietly(int argc, char** argv, const std::string& name, std::uint32_t options = 0);

/** @throws std::runtime_error when no ROS master answers, with what to do in one line. */
void requireMaster();

}  // namespace view_servo
