// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/numbers.h"

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <algorithm>
#include <string>

namespace view_servo
{
/** Times that something took, from one diagnosis to the next. Not for several threads at once. */
class Timings
{
public:
  /** Adds one time. @param duration [ms]. */
  void add(double duration)
  {
    count_ += 1;
    sum_ += duration;
    largest_ = std::max(largest_, duration);
  }

  /** Adds mean and largest, NaN when there were none, under "NAME, mean [ms]" and "NAME, largest [ms]"; begins anew. */
  void report(diagnostic_updater::DiagnosticStatusWrapper& status, const std::string& name)
  {
    status.add(name + ", mean [ms]", count_ > 0 ? sum_ / count_ : NOT_A_NUMBER);
    status.add(name + ", largest [ms]", count_ > 0 ? largest_ : NOT_A_NUMBER);
    *this = Timings();
  }

private:
  int count_ = 0;
  double sum_ = 0.0;
  double largest_ = 0.0;
};

}  // namespace view_servo
