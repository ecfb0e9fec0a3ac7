// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/readiness.h"

#include <ros/console.h>
#include <ros/init.h>

#include <chrono>
#include <thread>

namespace view_servo
{
std::string waitUntilReady(double patience, const std::function<std::string()>& missing,
                           const std::function<bool()>& given_up)
{
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds POLL(5);
  constexpr std::chrono::seconds REMINDER(3);
  const auto duration = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(patience));
  const Clock::time_point deadline = Clock::now() + duration;
  Clock::time_point reminder = Clock::now() + REMINDER;
  while (true)
  {
    std::string what = missing();
    const Clock::time_point now = Clock::now();
    if (what.empty() || now >= deadline || (given_up && given_up()) || !ros::ok())
    {
      return what;
    }
    if (now >= reminder)
    {
      ROS_INFO_STREAM("still waiting: " << what);
      reminder = now + REMINDER;
    }
    std::this_thread::sleep_for(POLL);
  }
}

}  // namespace view_servo
