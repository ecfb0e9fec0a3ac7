// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mutex>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * Passes values from callbacks, which must not wait, to a thread that takes them later. Nothing is called while its
 * lock is held, so it can be used with any other lock held.
 */
template <typename T>
class Inbox
{
public:
  /** Adds a value. */
  void put(T value)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    values_.push_back(std::move(value));
  }

  /** All that were put since the last time, oldest first. */
  std::vector<T> takeAll()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(values_, {});
  }

private:
  std::mutex mutex_;
  std::vector<T> values_;
};

}  // namespace view_servo
