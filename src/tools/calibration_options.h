// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/command_line.h"
#include "tools/hand_eye_session.h"

#include <string>

namespace view_servo
{
/** What both calibrate_hand_eye and calibrate_mount take on their command lines. */
struct CalibrationOptions
{
  HandEyeSources sources;
  int poses = 0;           ///< how many have to agree
  std::string file;        ///< with what was recorded before; empty: the robot is there
  std::string keep;        ///< file to write the poses to; empty: none
  std::string out;         ///< file to write the result to
  bool overwrite = false;  ///< files that exist are replaced

  /** Whether `file` is a bag; else it is one that `keep` named once. */
  bool fileIsBag() const;
};

/** Adds the options that say where poses come from, and how many. What `options` holds is their defaults. */
void addSourceOptions(CommandLine& line, CalibrationOptions& options);

/** Adds the options that name files. What `options` holds is their defaults. */
void addFileOptions(CommandLine& line, CalibrationOptions& options);

/**
 * Reads a command line into what is bound to `line`, of which `options` is a part.
 * @return false when --help was asked for, and has been printed.
 * @throws std::runtime_error when it cannot be understood, or names no view, or a file that would be replaced.
 */
bool readCalibrationOptions(CommandLine& line, int argc, char** argv, const CalibrationOptions& options);

}  // namespace view_servo
