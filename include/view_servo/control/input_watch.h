// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>

namespace view_servo
{
/**
 * Watches over an input that a moving robot depends on: stale when nothing came for too long, by a steady clock, which
 * neither a paused bag nor a set system clock disturbs. Fresh input makes it good again. Safe to use from several threads.
 */
class InputWatch
{
public:
  using Clock = std::chrono::steady_clock;

  /** @param timeout [s]. */
  explicit InputWatch(double timeout) : timeout_(timeout)
  {
  }

  void feed()
  {
    last_ = Clock::now();
  }

  /** Time since the input was last fed, or since this object was made [s]. */
  double age() const
  {
    return std::chrono::duration<double>(Clock::now() - last_.load()).count();
  }

  bool stale() const
  {
    return age() > timeout_;
  }

  double timeout() const
  {
    return timeout_;
  }

private:
  const double timeout_;
  std::atomic<Clock::time_point> last_{ Clock::now() };
};

}  // namespace view_servo
