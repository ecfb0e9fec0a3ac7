// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/report.h"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace view_servo::check
{
namespace
{
constexpr int LEVEL_WIDTH = 9;
constexpr int NAME_WIDTH = 18;

std::string counted(std::ptrdiff_t count, const std::string& what)
{
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

}  // namespace

std::string toLines(const Findings& findings)
{
  std::ostringstream text;
  text << std::left;
  for (const Finding& finding : findings)
  {
    std::string level = toText(finding.level);
    if (finding.level != Level::OK)
    {
      std::transform(level.begin(), level.end(), level.begin(),
                     [](char c) { return static_cast<char>(c - 'a' + 'A'); });
    }
    text << std::setw(LEVEL_WIDTH) << level << std::setw(NAME_WIDTH) << finding.name << finding.message << '\n';
    if (!finding.remedy.empty())
    {
      text << std::string(LEVEL_WIDTH + NAME_WIDTH, ' ') << "-> " << finding.remedy << '\n';
    }
  }
  return text.str();
}

std::string summary(const Findings& findings)
{
  const auto count = [&](Level level) {
    return std::count_if(findings.begin(), findings.end(),
                         [level](const Finding& finding) { return finding.level == level; });
  };
  return std::to_string(count(Level::OK)) + " ok, " + counted(count(Level::WARNING), "warning") + ", " +
         counted(count(Level::ERROR), "error");
}

}  // namespace view_servo::check
