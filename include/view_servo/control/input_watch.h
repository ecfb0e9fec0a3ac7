// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/seconds_since.h"

#include <atomic>
#include <chrono>

namespace view_servo
{
/**
 * Tells whether an input that a moving robot depends on has become stale, which it is when nothing came for longer than
 * a timeout. Time is that of a steady clock: a paused bag does not stop it, nor does setting the system's clock disturb
 * it. New input makes it fresh again. Safe to use from several threads.
 */
class InputWatch
{
public:
  using Clock = std::chrono::steady_clock;

  /** @param timeout largest age() of input that is not stale [s]. */
  explicit InputWatch(double timeout) : timeout_(timeout)
  {
  }

  /** Input has come. */
  void restart()
  {
    last_ = Clock::now();
  }

  /** Time since restart() was last called, or since this object was made [s]. */
  double age() const
  {
    return secondsSince(last_.load());
  }

  /** Whether age() exceeds the timeout. */
  bool stale() const
  {
    return age() > timeout_;
  }

  /** As given to the constructor [s]. */
  double timeout() const
  {
    return timeout_;
  }

private:
  const double timeout_;
  std::atomic<Clock::time_point> last_{ Clock::now() };
};

}  // namespace view_servo
