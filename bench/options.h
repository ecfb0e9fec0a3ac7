// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** What a benchmark is asked for: MODE [--runs N] [--seed N] [--set NAME=VALUE ...]. */
struct BenchOptions
{
  std::string mode;        ///< empty: none was given
  int runs = 1;            ///< at least 1
  std::uint64_t seed = 1;  ///< of what is drawn at random
};

/**
 * @param runs unless --runs says otherwise. @param table of the parameters that --set changes.
 * @throws std::invalid_argument or std::out_of_range for unknown options and for bad values.
 */
inline BenchOptions readOptions(int argc, char** argv, int runs, const std::vector<Parameter>& table)
{
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  BenchOptions options;
  options.mode = arguments.empty() ? "" : arguments.front();
  options.runs = runs;
  for (std::size_t i = 1; i < arguments.size(); i += 2)
  {
    const std::string value = i + 1 < arguments.size() ? arguments[i + 1] : "";
    const std::size_t equals = value.find('=');
    if (arguments[i] == "--runs")
    {
      options.runs = std::max(1, std::stoi(value));
    }
    else if (arguments[i] == "--seed")
    {
      options.seed = std::stoull(value);
    }
    else if (arguments[i] == "--set" && equals != std::string::npos)
    {
      setParameter(table, value.substr(0, equals), value.substr(equals + 1));
    }
    else
    {
      throw std::invalid_argument("unknown option or no value: " + arguments[i]);
    }
  }
  return options;
}

}  // namespace view_servo
