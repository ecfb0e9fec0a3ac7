// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/run_command_line.h"

#include "view_servo/parameters/error_text.h"

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <iostream>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int DONE = 0;
constexpr int BAD_INPUT = 2;

std::string helpOf(const RunProgram& program, const std::vector<Parameter>& table)
{
  std::string text = program.introduction + "\n\n  rosrun view_servo " + program.name +
                     " [_PARAMETER:=VALUE...]\n\nParameters, and their defaults:\n";
  for (const Parameter& parameter : table)
  {
    const std::string range = parameter.range.empty() ? "" : "; " + parameter.range;
    const std::string unit = parameter.unit.empty() ? "" : " [" + parameter.unit + range + "]";
    text += "  _" + parameter.name + ":=" + parameter.get() + "\n      " + parameter.description + unit + '\n';
  }
  return text + "Exit status: 0 the robot came to the view, 1 it did not, 2 the command line is wrong.";
}

/** A value as ROS reads it, for which "True" and "TRUE" are true, too. */
std::string asRosReads(const std::string& value)
{
  std::string small = value;
  std::transform(small.begin(), small.end(), small.begin(), [](unsigned char c) { return std::tolower(c); });
  return small == "true" || small == "false" ? small : value;
}

}  // namespace

std::optional<int> answerCommandLine(int argc, char** argv, const RunProgram& program, const RunParams& defaults)
{
  RunParams params = defaults;
  const std::vector<Parameter> table = parameters(params);
  const std::string help = helpOf(program, table);
  try
  {
    for (int i = 1; i < argc; ++i)
    {
      const std::string word = argv[i];
      const std::size_t assignment = word.find(":=");
      if (word == "--help" || word == "-h")
      {
        std::cout << help << std::endl;
        return DONE;
      }
      if (assignment == std::string::npos)
      {
        throw std::invalid_argument("'" + word + "' is not understood");
      }
      if (word[0] == '_' && word[1] != '_')
      {
        setParameter(table, word.substr(1, assignment - 1), asRosReads(word.substr(assignment + 2)));
      }
    }
    if (const std::vector<std::string> faults = faultsOf(table); !faults.empty())
    {
      throw std::invalid_argument(faults.front());
    }
  }
  catch (const std::invalid_argument& error)
  {
    std::cerr << program.name << ": " << oneLine(error) << "; see --help" << std::endl;
    return BAD_INPUT;
  }
  return std::nullopt;
}

}  // namespace view_servo
