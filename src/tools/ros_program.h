// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/command_line.h"

#include "view_servo/ros/steady_wait.h"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
/** @file How command-line programs that use ROS begin. */

/**
 * As CommandLine::parse(), of the words that are not for ROS, such as "camera:=/front" or "__ns:=/robot1". Needs
 * neither ros::init() nor a master.
 */
std::optional<std::vector<std::string>> parseWithoutRosWords(CommandLine& line, int argc, char** argv);

/**
 * As ros::init(), for a program that writes nothing on standard error but one line when it fails: what ROS logs is not
 * printed, unless it is fatal. Several such programs may run at once. @param options besides that, of
 * ros::init_options::InitOption.
 */
void initQuietly(int argc, char** argv, const std::string& name, std::uint32_t options = 0);

/** @throws std::runtime_error when no ROS master answers within a few seconds, with what to do in one line. */
void requireMaster();

/**
 * What `body` returns. It runs in a thread of its own, as roscpp gives its calls no deadline, which is left behind when
 * it takes longer: `body` must not throw, nor refer to what may be gone by then. @return empty when it takes longer.
 */
template <typename Body>
auto within(std::chrono::seconds longest, Body body) -> std::optional<decltype(body())>
{
  struct Shared
  {
    std::mutex mutex;
    std::condition_variable condition;
    std::optional<decltype(body())> result;
  };
  const auto shared = std::make_shared<Shared>();
  std::thread([shared, body = std::move(body)]() mutable {
    auto result = body();
    const std::lock_guard<std::mutex> lock(shared->mutex);
    shared->result = std::move(result);
    shared->condition.notify_all();
  }).detach();
  std::unique_lock<std::mutex> lock(shared->mutex);
  waitSteadily(shared->condition, lock, longest, [&] { return shared->result.has_value(); });
  return std::move(shared->result);
}

}  // namespace view_servo
