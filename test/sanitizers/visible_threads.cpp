// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Part of the core in a build with ThreadSanitizer, which does not see how the threads of OpenCV's TBB hand work on. So
// cv::parallel_for_() starts threads of the standard library instead, and joins them; where OpenCV (before 4.5.2)
// cannot be told to, it uses one.
#include <opencv2/core/utility.hpp>

#if __has_include(<opencv2/core/parallel/parallel_backend.hpp>)
#include <opencv2/core/parallel/parallel_backend.hpp>

#include <memory>
#include <thread>
#include <vector>

namespace
{
class VisibleThreads : public cv::parallel::ParallelForAPI
{
public:
  /** Each thread, the caller's too, gets one contiguous part of the tasks. */
  void parallel_for(int tasks, FN_parallel_for_body_cb_t body, void* data) override
  {
    const auto part = [=](int i) {
      t_number = i;
      const int begin = static_cast<int>(static_cast<long long>(tasks) * i / threads_);
      const int end = static_cast<int>(static_cast<long long>(tasks) * (i + 1) / threads_);
      if (begin < end)
      {
        body(begin, end, data);
      }
    };
    std::vector<std::thread> others;
    for (int i = 1; i < threads_; ++i)
    {
      others.emplace_back(part, i);
    }
    part(0);
    for (std::thread& other : others)
    {
      other.join();
    }
  }

  int getThreadNum() const override
  {
    return t_number;
  }

  int getNumThreads() const override
  {
    return threads_;
  }

  int setNumThreads(int threads) override
  {
    const int before = threads_;
    threads_ = threads > 0 ? threads : DEFAULT;
    return before;
  }

  const char* getName() const override
  {
    return "visible threads";
  }

private:
  static constexpr int DEFAULT = 2;
  static thread_local int t_number;
  int threads_ = DEFAULT;
};

thread_local int VisibleThreads::t_number = 0;

const bool g_visible = [] {
  cv::parallel::setParallelForBackend(std::make_shared<VisibleThreads>(), false);
  return true;
}();
}  // namespace
#else
namespace
{
const bool g_one_thread = [] {
  cv::setNumThreads(1);
  return true;
}();
}  // namespace
#endif
