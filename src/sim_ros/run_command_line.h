// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim_ros/run_params.h"

#include <optional>
#include <string>

namespace view_servo
{
/** A program that runs a simulated robot once. */
struct RunProgram
{
  std::string name;          ///< of the program and its node
  std::string what;          ///< what is run, in a word, to begin the line with that says how it went
  std::string introduction;  ///< what the program does, for --help
};

/**
 * Looks at a command line before ROS does, which waits for a master: answers --help, and refuses what is not
 * understood, with one line on standard error. Parameters are words such as _timeout:=60; what else has ":=" is ROS'
 * own.
 * @param defaults of the parameters.
 * @return the exit status when the program is to end: 0 after --help, 2 when the command line is wrong.
 */
std::optional<int> answerCommandLine(int argc, char** argv, const RunProgram& program, const RunParams& defaults);

}  // namespace view_servo
