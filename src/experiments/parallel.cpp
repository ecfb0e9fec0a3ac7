// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/parallel.h"

#include <algorithm>
#include <atomic>
#include <ctime>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace view_servo
{
void inParallel(std::size_t count, int max_threads, const std::function<void(std::size_t)>& work)
{
  const unsigned int wanted =
      max_threads > 0 ? static_cast<unsigned int>(max_threads) : std::max(1U, std::thread::hardware_concurrency());
  std::atomic<std::size_t> next{ 0 };
  std::exception_ptr failure;
  std::mutex mutex;
  std::vector<std::thread> threads;
  for (unsigned int k = 0; k < wanted; ++k)
  {
    threads.emplace_back([&] {
      try
      {
        for (std::size_t i = next++; i < count; i = next++)
        {
          work(i);
        }
      }
      catch (...)
      {
        const std::lock_guard<std::mutex> lock(mutex);
        failure = std::current_exception();
        next = count;
      }
    });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  if (failure)
  {
    std::rethrow_exception(failure);
  }
}

double threadSeconds()
{
  timespec used{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

}  // namespace view_servo
