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
 * Passes values from one thread to another. It holds one value, which a newer one replaces. Nothing is called while its
 * lock is held, so it can be used with any other lock held.
 */
template <typename T>
class Mailbox
{
public:
  /** Puts a value in, in place of one that is there. */
  void put(T value)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      value_ = std::move(value);
    }
    changed_.notify_all();
  }

  /** Takes the value out; empty when there is none. */
  std::optional<T> take()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(value_, std::nullopt);
  }

  /** Waits for a value and takes it out; empty once the box is closed. */
  std::optional<T> wait()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || value_; });
    return closed_ ? std::nullopt : std::exchange(value_, std::nullopt);
  }

  /** Ends all waits, now and later. */
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
