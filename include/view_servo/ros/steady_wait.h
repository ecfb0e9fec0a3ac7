// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pthread.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <ctime>
#include <mutex>

namespace view_servo
{
/**
 * Waits until `holds()`, which is called with the lock held, or until a time of the steady clock. Before GCC 10,
 * std::condition_variable waits by the system's clock, and for an hour longer when that is set back by an hour.
 * @return what `holds()` says in the end.
 */
template <typename Holds>
bool waitSteadily(std::condition_variable& condition, std::unique_lock<std::mutex>& lock,
                  std::chrono::steady_clock::time_point end, const Holds& holds)
{
  const auto since_epoch = end.time_since_epoch();  // of CLOCK_MONOTONIC, which steady_clock is on Linux
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(since_epoch);
  timespec deadline{};
  deadline.tv_sec = static_cast<time_t>(whole.count());
  deadline.tv_nsec = static_cast<long>(std::chrono::nanoseconds(since_epoch - whole).count());
  while (!holds())
  {
    if (pthread_cond_clockwait(condition.native_handle(), lock.mutex()->native_handle(), CLOCK_MONOTONIC, &deadline) ==
        ETIMEDOUT)
    {
      return holds();
    }
  }
  return true;
}

/** Likewise for so long at most. */
template <typename Holds>
bool waitSteadily(std::condition_variable& condition, std::unique_lock<std::mutex>& lock,
                  std::chrono::steady_clock::duration longest, const Holds& holds)
{
  return waitSteadily(condition, lock, std::chrono::steady_clock::now() + longest, holds);
}

}  // namespace view_servo
