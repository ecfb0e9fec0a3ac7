// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>

namespace view_servo
{
/**
 * A place for one value on its way from one thread to another; a newer one replaces it. Its lock is a leaf: nothing is called
 * while it is held.
 */
template <typename T>
class Mailbox
{
public:
  void put(T value)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      value_ = std::move(value);
    }
    changed_.notify_all();
  }

  /** What is there; empty: nothing is. */
  std::optional<T> take()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(value_, std::nullopt);
  }

  /** Waits until something is there; empty: the box was closed. */
  std::optional<T> wait()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || value_; });
    return closed_ ? std::nullopt : std::exchange(value_, std::nullopt);
  }

  /** Ends all waits, for good. */
  void close()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    changed_.notify_all();
  }

private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<T> value_;
  bool closed_ = false;
};

}  // namespace view_servo
