// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <ros/service_client.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace view_servo
{
/** What came of calling a service. */
struct CallOutcome
{
  enum Kind
  {
    ANSWERED,    ///< the response is there
    NO_SERVICE,  ///< nobody offers it
    LATE,        ///< it did not answer in time
    FAILED,      ///< it reported a failure, or its node has gone
    GIVEN_UP     ///< something else had to be done at once
  };
  Kind kind;
  std::string text;  ///< what is wrong, in words; empty when it has answered
};

struct TaskQueue;

/** Calls services for one task of a TaskWorker. */
class ServiceCaller
{
public:
  ServiceCaller(TaskQueue& queue, unsigned generation) : queue_(queue), generation_(generation)
  {
  }

  /** @param name resolved. @param patience how long it may take [s]. */
  template <typename Service>
  CallOutcome call(const std::string& name, Service& service, double patience)
  {
    constexpr bool PERSISTENT = true;  // see callService(); and it is connected here, not by call()
    lookUp(name);
    ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(name, PERSISTENT);
    if (!client.isValid())
    {
      lookUp("");
      return { CallOutcome::NO_SERVICE, "there is no service " + name };
    }
    if (!begin(client, patience))
    {
      return end(name, false, patience);
    }
    const bool answered = client.call(service);
    return end(name, answered, patience);
  }

private:
  /** Says which service is asked for at the master, which may take as long as it likes. @param name empty: none is. */
  void lookUp(const std::string& name);
  /** Lets expire() end the call; false when it must not begin, as room has to be made. */
  bool begin(const ros::ServiceClient& client, double patience);
  /** Says how a call ended. */
  CallOutcome end(const std::string& name, bool answered, double patience);

  TaskQueue& queue_;
  const unsigned generation_;
};

/**
 * Runs tasks one after the other in a thread of its own. Calls of services that are late, or that have to make room,
 * are ended by expire(), as roscpp knows no deadline. Its methods do not wait, and are for one thread.
 */
class TaskWorker
{
public:
  /** Must not throw. */
  using Task = std::function<void(ServiceCaller&)>;

  TaskWorker();
  /** Waits for the running task, half a second at most; one that hangs longer, as in a dead network, is left behind. */
  ~TaskWorker();
  TaskWorker(const TaskWorker&) = delete;
  TaskWorker& operator=(const TaskWorker&) = delete;

  /** Runs a task after those that wait. */
  void add(Task task);
  /** Drops what waits, gives up the calls of what runs, and runs the task next. */
  void replace(Task task);
  /** As replace(); later tasks are not run any more. */
  void finish(Task task);
  /** Ends calls that are late or given up. To be called often. */
  void expire();
  /** Whether nothing runs or waits. */
  bool isIdle() const;
  /** The service that the master has been asked for, for longer than a time [s]; empty: none. No such call can be ended. */
  std::string waitsForMaster(double patience) const;

private:
  std::shared_ptr<TaskQueue> queue_;  // shared with the thread, which may outlive this object
  std::thread thread_;
};

}  // namespace view_servo
