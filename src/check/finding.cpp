// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/finding.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace view_servo::check
{
Finding ok(const std::string& name, const std::string& message)
{
  return { Level::OK, name, message, "" };
}

Finding warning(const std::string& name, const std::string& message, const std::string& remedy)
{
  return { Level::WARNING, name, message, remedy };
}

Finding error(const std::string& name, const std::string& message, const std::string& remedy)
{
  return { Level::ERROR, name, message, remedy };
}

int exitStatus(const Findings& findings)
{
  int status = 0;
  for (const Finding& finding : findings)
  {
    status = std::max(status, static_cast<int>(finding.level));
  }
  return status;
}

const Finding* find(const Findings& findings, const std::string& name)
{
  const auto found =
      std::find_if(findings.begin(), findings.end(), [&](const Finding& finding) { return finding.name == name; });
  return found == findings.end() ? nullptr : &*found;
}

void append(Findings& findings, const Findings& more)
{
  findings.insert(findings.end(), more.begin(), more.end());
}

std::string toText(Level level)
{
  return level == Level::OK ? "ok" : level == Level::WARNING ? "warning" : "error";
}

std::string number(double value, int decimals)
{
  std::ostringstream text;
  text << std::fixed << std::setprecision(decimals) << value;
  return text.str();
}

std::string shortTime(double time)
{
  return std::abs(time) < 1.0 ? number(1e3 * time, 0) + " ms" : number(time, 1) + " s";
}

}  // namespace view_servo::check
