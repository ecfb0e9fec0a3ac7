// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/view_match.h"

#include <chrono>
#include <string>
#include <vector>

namespace view_servo
{
/** Measures how long the stages of some work take, by a steady clock. */
class StageClock
{
public:
  /** `stages` must outlive the clock, which adds to it. */
  explicit StageClock(std::vector<StageTime>& stages) : stages_(stages), start_(Clock::now()), last_(start_)
  {
  }
  /** Adds the time since the last call, or since the construction, to the stage of that name. */
  void finish(const std::string& stage)
  {
    const Clock::time_point now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    for (StageTime& known : stages_)
    {
      if (known.name == stage)
      {
        known.ms += ms;
        return;
      }
    }
    stages_.push_back({ stage, ms });
  }
  /** Time since the construction [ms]. */
  double total() const
  {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }

private:
  using Clock = std::chrono::steady_clock;
  std::vector<StageTime>& stages_;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace view_servo
