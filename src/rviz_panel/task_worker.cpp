// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/task_worker.h"

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include <view_servo/ros/node_base.h>
#include <view_servo/ros/steady_wait.h>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

/** A call. A client that is shut down while call() has not begun to wait would connect anew, so that takes a moment. */
struct RunningCall
{
  ros::ServiceClient client;
  Clock::time_point begin;
  Clock::time_point deadline;
  unsigned generation;  // of its task
  bool is_late = false;
};

constexpr std::chrono::milliseconds BEGINNING(50);
constexpr std::chrono::milliseconds PATIENCE_AT_THE_END(500);

}  // namespace

/** What the thread and its owner share. */
struct TaskQueue
{
  mutable std::mutex mutex;
  std::condition_variable changed;
  std::deque<TaskWorker::Task> tasks;
  std::optional<RunningCall> call;
  std::string looked_up;  // service that the master is asked for; empty: none
  Clock::time_point looked_up_since;
  unsigned generation = 0;  // calls of tasks that began in an earlier one are given up
  bool is_running = false;
  bool is_finishing = false;
  bool has_ended = false;

  void run()
  {
    std::unique_lock<std::mutex> lock(mutex);
    while (true)
    {
      changed.wait(lock, [this] { return !tasks.empty() || is_finishing; });
      if (tasks.empty())
      {
        break;
      }
      TaskWorker::Task task = std::move(tasks.front());
      tasks.pop_front();
      is_running = true;
      ServiceCaller caller(*this, generation);
      lock.unlock();
      task(caller);
      task = nullptr;
      lock.lock();
      is_running = false;
    }
    has_ended = true;
    changed.notify_all();
  }

  void replace(TaskWorker::Task task, bool is_last)
  {
    const std::lock_guard<std::mutex> lock(mutex);
    tasks.clear();
    ++generation;
    if (task)
    {
      tasks.push_back(std::move(task));
    }
    is_finishing = is_finishing || is_last;
    changed.notify_all();
  }
};

void ServiceCaller::lookUp(const std::string& name)
{
  const std::lock_guard<std::mutex> lock(queue_.mutex);
  queue_.looked_up = name;
  queue_.looked_up_since = Clock::now();
}

bool ServiceCaller::begin(const ros::ServiceClient& client, double patience)
{
  const std::lock_guard<std::mutex> lock(queue_.mutex);
  queue_.looked_up.clear();
  if (queue_.generation != generation_)
  {
    return false;
  }
  const Clock::time_point now = Clock::now();
  queue_.call =
      RunningCall{ client, now, now + std::chrono::milliseconds(static_cast<int>(1000 * patience)), generation_ };
  return true;
}

CallOutcome ServiceCaller::end(const std::string& name, bool answered, double patience)
{
  const std::lock_guard<std::mutex> lock(queue_.mutex);
  const bool is_late = queue_.call && queue_.call->is_late;
  queue_.call.reset();
  if (queue_.generation != generation_)
  {
    return { CallOutcome::GIVEN_UP, name + " was not waited for" };
  }
  if (answered)
  {
    return { CallOutcome::ANSWERED, "" };
  }
  return is_late ? CallOutcome{ CallOutcome::LATE, name + " has not answered within " + seconds(patience) }
                 : CallOutcome{ CallOutcome::FAILED, name + " has failed: look at its node's output" };
}

TaskWorker::TaskWorker() : queue_(std::make_shared<TaskQueue>())
{
  thread_ = std::thread([queue = queue_] { queue->run(); });
}

TaskWorker::~TaskWorker()
{
  {
    const std::lock_guard<std::mutex> lock(queue_->mutex);
    queue_->is_finishing = true;
  }
  queue_->changed.notify_all();
  const Clock::time_point deadline = Clock::now() + PATIENCE_AT_THE_END;
  bool has_ended = false;
  while (!has_ended && Clock::now() < deadline)
  {
    expire();
    std::unique_lock<std::mutex> lock(queue_->mutex);
    has_ended = waitSteadily(queue_->changed, lock, BEGINNING / 2, [this] { return queue_->has_ended; });
  }
  if (has_ended)
  {
    thread_.join();
    return;
  }
  queue_->replace(nullptr, true);
  thread_.detach();
}

void TaskWorker::add(Task task)
{
  {
    const std::lock_guard<std::mutex> lock(queue_->mutex);
    queue_->tasks.push_back(std::move(task));
  }
  queue_->changed.notify_all();
}

void TaskWorker::replace(Task task)
{
  queue_->replace(std::move(task), false);
  expire();
}

void TaskWorker::finish(Task task)
{
  queue_->replace(std::move(task), true);
  expire();
}

void TaskWorker::expire()
{
  std::optional<ros::ServiceClient> ended;
  {
    const std::lock_guard<std::mutex> lock(queue_->mutex);
    if (!queue_->call)
    {
      return;
    }
    RunningCall& call = *queue_->call;
    const Clock::time_point now = Clock::now();
    call.is_late = call.is_late || now > call.deadline;
    const bool is_given_up = call.generation != queue_->generation;
    if ((call.is_late || is_given_up) && now > call.begin + BEGINNING)
    {
      ended = call.client;
    }
  }
  if (ended)
  {
    ended->shutdown();  // its call() returns
  }
}

std::string TaskWorker::waitsForMaster(double patience) const
{
  const std::lock_guard<std::mutex> lock(queue_->mutex);
  const bool is_late = std::chrono::duration<double>(Clock::now() - queue_->looked_up_since).count() > patience;
  return is_late ? queue_->looked_up : "";
}

bool TaskWorker::isIdle() const
{
  const std::lock_guard<std::mutex> lock(queue_->mutex);
  return !queue_->is_running && queue_->tasks.empty();
}

}  // namespace view_servo
