// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/robust/quantile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <functional>
#include <iomanip>
#include <ostream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * Of times that were taken in turn, the median of a time over the other one that was taken next to it: the machine's
 * speed, which changes meanwhile, cancels out.
 */
inline double medianQuotient(const std::vector<double>& times, const std::vector<double>& others)
{
  std::vector<double> quotients(times.size());
  std::transform(times.begin(), times.end(), others.begin(), quotients.begin(), std::divides<>());
  return medianOf(quotients);
}

/**
 * Times of ours as parts of a peer's, measured in one run, which say the same on machines of different speed. A file
 * keeps them, one a line: the ratio, a blank and its name.
 */
class Ratios
{
public:
  static constexpr double MOST_WORSE = 1.15;  ///< by this factor a ratio may be larger than before

  void add(const std::string& name, double ratio)
  {
    all_.emplace_back(name, ratio);
  }

  /** @throws std::runtime_error when the file cannot be written. */
  void write(const std::string& file) const
  {
    std::ofstream out(file);
    out << std::fixed << std::setprecision(3);
    for (const auto& [name, ratio] : all_)
    {
      out << ratio << ' ' << name << '\n';
    }
    out.close();
    if (!out)
    {
      throw std::runtime_error("cannot write '" + file + "'");
    }
  }

  /** Of an earlier run. @throws std::runtime_error when the file cannot be read, or a line is not as write() has it. */
  static Ratios read(const std::string& file)
  {
    std::ifstream in(file);
    if (!in)
    {
      throw std::runtime_error("cannot read '" + file + "'");
    }
    Ratios ratios;
    for (std::string line; std::getline(in, line);)
    {
      std::size_t end = 0;
      double ratio = 0.0;
      try
      {
        ratio = std::stod(line, &end);
      }
      catch (const std::logic_error&)
      {
        end = 0;
      }
      if (end == 0 || end + 1 >= line.size() || line[end] != ' ' || !(ratio > 0.0) || !std::isfinite(ratio))
      {
        throw std::runtime_error("'" + file + "' has a line that is not a ratio and its name: '" + line + "'");
      }
      ratios.add(line.substr(end + 1), ratio);
    }
    return ratios;
  }

  /**
   * Compares with those of an earlier run, and prints each one that is worse by more than MOST_WORSE, or that only one
   * of the two runs has. @return whether there was none.
   */
  bool isAsGoodAs(const Ratios& earlier, std::ostream& out) const
  {
    bool good = !all_.empty();
    out << std::fixed << std::setprecision(3) << (good ? "" : "nothing was measured\n");
    for (const auto& [name, before] : earlier.all_)
    {
      const double* now = find(name);
      if (now == nullptr)
      {
        good = false;
        out << name << ": not measured, " << before << " before\n";
      }
      else if (!(*now <= MOST_WORSE * before))
      {
        good = false;
        out << name << ": " << *now << ", " << before << " before\n";
      }
    }
    for (const auto& [name, now] : all_)
    {
      if (earlier.find(name) == nullptr)
      {
        good = false;
        out << name << ": " << now << ", not measured before\n";
      }
    }
    return good;
  }

private:
  const double* find(const std::string& name) const
  {
    for (const auto& [other, ratio] : all_)
    {
      if (other == name)
      {
        return &ratio;
      }
    }
    return nullptr;
  }

  std::vector<std::pair<std::string, double>> all_;
};

}  // namespace view_servo
