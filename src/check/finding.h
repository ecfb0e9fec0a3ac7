// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace view_servo::check
{
/** How bad a finding is. */
enum class Level
{
  OK,       ///< all is well
  WARNING,  ///< it may work, but worse than it could, or it cannot be told
  ERROR     ///< the nodes will refuse, or the robot will go wrong
};

/** What came of looking at one part of a robot's set-up. */
struct Finding
{
  Level level;
  std::string name;     ///< of the part, such as "calibration"
  std::string message;  ///< what was found, one line
  std::string remedy;   ///< what to do; empty when all is well
};

using Findings = std::vector<Finding>;

/** A finding of level OK, without a remedy. */
Finding ok(const std::string& name, const std::string& message);
/** A finding of level WARNING. Arguments as the members of Finding. */
Finding warning(const std::string& name, const std::string& message, const std::string& remedy);
/** A finding of level ERROR. Arguments as the members of Finding. */
Finding error(const std::string& name, const std::string& message, const std::string& remedy);

/** The exit status: 0 all is well, 1 there are warnings, 2 there are errors. */
int exitStatus(const Findings& findings);

/** The first finding about a part; null when there is none. */
const Finding* find(const Findings& findings, const std::string& name);

/** Puts `more` at the end of `findings`. */
void append(Findings& findings, const Findings& more);

/** "ok", "warning" or "error". */
std::string toText(Level level);

/** A number with `decimals` digits after the point. */
std::string number(double value, int decimals);

/** A time in milliseconds, or in seconds when it is a second or more. @param time [s]. */
std::string shortTime(double time);

}  // namespace view_servo::check
