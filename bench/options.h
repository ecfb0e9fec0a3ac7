// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "ratios.h"
#include "view_servo/parameters/parameter.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** What a benchmark is asked for: MODE [--runs N] [--seed N] [--write FILE] [--check FILE] [--set NAME=VALUE ...]. */
struct BenchOptions
{
  std::string mode;        ///< empty: none was given
  int runs = 1;            ///< at least 1
  std::uint64_t seed = 1;  ///< of what is drawn at random
  std::string write;       ///< file for the ratios of times, see Ratios; empty: none
  std::string check;       ///< file of ratios of an earlier run, to be compared with; empty: none
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
    else if (arguments[i] == "--write" && !value.empty())
    {
      options.write = value;
    }
    else if (arguments[i] == "--check" && !value.empty())
    {
      options.check = value;
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

/** @throws std::invalid_argument when ratios are asked for of something that `has_none`. */
inline void requireNoRatios(const BenchOptions& options, bool has_none)
{
  if (has_none && !(options.write.empty() && options.check.empty()))
  {
    throw std::invalid_argument("--write and --check are for ratios of times, which '" + options.mode + "' has not");
  }
}

/** Writes and compares the ratios as asked. @return the exit status: 1 when they are worse than those of the file. */
inline int finish(const Ratios& ratios, const BenchOptions& options)
{
  if (!options.write.empty())
  {
    ratios.write(options.write);
  }
  if (options.check.empty())
  {
    return 0;
  }
  const bool good = ratios.isAsGoodAs(Ratios::read(options.check), std::cout);
  std::cout << (good ? "no ratio is" : "some ratios are") << " more than 15 % worse than in " << options.check << '\n';
  return good ? 0 : 1;
}

}  // namespace view_servo
