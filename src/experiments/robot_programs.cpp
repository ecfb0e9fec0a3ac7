// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/robot_programs.h"

#include "tools/package_folder.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace view_servo
{
void becomeRobotProgram(const std::string& script, const RobotProgramOptions& options)
{
  const std::filesystem::path path = packageFolder() / script;
  if (!std::filesystem::exists(path))
  {
    throw std::runtime_error(path.string() +
                             " is not there: this runs from the package's source tree only; clone it into a "
                             "workspace, build it there, and source its devel/setup.bash");
  }
  std::vector<std::string> words{ path.string(), "--out", options.out.string() };
  const auto add = [&words](const std::string& option, const auto& value) {
    if (value)
    {
      std::ostringstream text;
      text << *value;
      words.insert(words.end(), { option, text.str() });
    }
  };
  add("--runs", options.runs);
  add("--seed", options.seed);
  add("--hours", options.hours);
  if (options.brief)
  {
    words.emplace_back("--short");
  }
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words)
  {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  std::cout.flush();
  execv(path.c_str(), arguments.data());
  throw std::runtime_error("cannot start " + path.string() + ": " + std::strerror(errno));
}

}  // namespace view_servo
