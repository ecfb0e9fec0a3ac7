// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <utility>

namespace view_servo::sim
{
/** @file
 * What the trials of both robots need to keep the times of a real driver in simulated time [s].
 */

/** Something that happens at time 0 and then once a period. */
class Every
{
public:
  /** @param period [s], > 0. */
  explicit Every(double period) : period_(period)
  {
  }

  /** Whether it is time for it; each time is asked for at most once, and times increase. */
  bool due(double time)
  {
    if (time < next_ - 1e-9)
    {
      return false;
    }
    next_ += period_;
    return true;
  }

private:
  double period_;
  double next_ = 0.0;
};

/** Values that are ready some time after they were begun, and are taken in the order in which they were begun. */
template <typename Value>
class Delayed
{
public:
  /** @param ready when the value may be taken. */
  void add(double ready, Value value)
  {
    waiting_.emplace_back(ready, std::move(value));
  }

  /** Takes the oldest value, if it is ready. */
  std::optional<Value> take(double time)
  {
    if (waiting_.empty() || time < waiting_.front().first)
    {
      return std::nullopt;
    }
    std::optional<Value> value(std::move(waiting_.front().second));
    waiting_.pop_front();
    return value;
  }

  bool empty() const
  {
    return waiting_.empty();
  }

private:
  std::deque<std::pair<double, Value>> waiting_;
};

}  // namespace view_servo::sim
