// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/node_base.h"

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

namespace view_servo
{
/**
 * A thread that works on inputs that others put there, so that they need not wait. It takes all of them at once.
 * The type `Inputs`, default-constructed empty, defines how inputs gather there. While the lock is held, only the edits
 * of put() are called.
 */
template <typename Inputs>
class Worker
{
public:
  /**
   * @param what the thread does, in words, for the log. @param work called by the thread with all inputs; what it
   * throws is logged.
   */
  Worker(std::string what, std::function<void(Inputs&&)> work) : what_(std::move(what)), work_(std::move(work))
  {
    thread_ = std::thread([this] { run(); });
  }
  ~Worker()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /** Edits the inputs and wakes the thread. @param edit has to be quick, and must not call put(). */
  template <typename Edit>
  void put(const Edit& edit)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      edit(inputs_);
      full_ = true;
    }
    wake_.notify_all();
  }

private:
  void run()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true)
    {
      wake_.wait(lock, [this] { return stopping_ || full_; });
      if (stopping_)
      {
        return;
      }
      full_ = false;
      Inputs inputs = std::exchange(inputs_, Inputs());
      lock.unlock();
      guarded(what_, [&] { work_(std::move(inputs)); });
      lock.lock();
    }
  }

  const std::string what_;
  const std::function<void(Inputs&&)> work_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable wake_;
  Inputs inputs_;
  bool full_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace view_servo
