// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** Collects what is wrong with parameters, for their validate(). */
class Faults
{
public:
  /** Adds `fault`, one line, unless `condition` holds. */
  void require(bool condition, std::string fault)
  {
    if (!condition)
    {
      list_.push_back(std::move(fault));
    }
  }
  /** Adds faults that were found elsewhere. */
  void add(const std::vector<std::string>& faults)
  {
    list_.insert(list_.end(), faults.begin(), faults.end());
  }
  /** All faults added so far, in their order. */
  const std::vector<std::string>& list() const
  {
    return list_;
  }

private:
  std::vector<std::string> list_;
};

/** @throws std::invalid_argument listing the faults of `what`, one a line, when there are any. */
inline void requireNoFaults(const std::string& what, const std::vector<std::string>& faults)
{
  if (faults.empty())
  {
    return;
  }
  std::string all = "bad " + what + ":";
  for (const std::string& fault : faults)
  {
    all += "\n  " + fault;
  }
  throw std::invalid_argument(all);
}

}  // namespace view_servo
