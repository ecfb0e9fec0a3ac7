// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
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
