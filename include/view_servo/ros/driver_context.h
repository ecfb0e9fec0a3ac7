// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/input_watch.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/ros/driver_params.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <ros/transport_hints.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** Something that has to go on coming while the robot moves. Used with the node's mutex held. */
class DriverInput
{
public:
  /** @param what comes, in words. @param topics where from. @param timeout without it, after which the robot stands [s]. */
  DriverInput(std::string what, std::string topics, double timeout)
    : what_(std::move(what)), topics_(std::move(topics)), watch_(timeout)
  {
  }

  /** Something has come that can be used. */
  void accept()
  {
    watch_.feed();
    problem_.clear();
    came_ = true;
  }
  /** Whether something that can be used has come, and not too long ago. */
  bool fresh() const
  {
    return came_ && !watch_.stale();
  }
  /** Something has come that cannot. @param problem why, one line. */
  void reject(const std::string& problem)
  {
    problem_ = problem;
  }
  /**
   * Judges the stamp of what has come: one that is zero, far in the future or the same as before cannot be used, and is rejected.
   * After one that has gone back, as when a bag loops, jump() says so.
   */
  bool checkStamp(const ros::Time& stamp);
  /** By how much the stamp judged last has gone back; empty: it has not. */
  const std::string& jump() const
  {
    return jump_;
  }
  /** The last one that could be used. */
  const ros::Time& lastStamp() const
  {
    return last_stamp_;
  }
  /** A goal begins: time counts from now. */
  void restart()
  {
    watch_.feed();
    problem_.clear();
  }
  /** Whether goals need it; at first they do. */
  void setNeeded(bool needed)
  {
    needed_ = needed;
  }

  /** What is missing, in one line; empty: nothing. */
  std::string missing() const;

  double age() const
  {
    return watch_.age();
  }
  const std::string& what() const
  {
    return what_;
  }
  const std::string& topics() const
  {
    return topics_;
  }
  /** Why what came last could not be used; empty: it could. */
  const std::string& problem() const
  {
    return problem_;
  }

private:
  std::string what_;
  std::string topics_;
  InputWatch watch_;
  std::string problem_;
  std::string jump_;
  ros::Time last_stamp_;
  bool came_ = false;
  bool needed_ = true;
};

/**
 * How far the stamps of odometry and images are apart, where it is so far that they cannot be used together: images may come late,
 * odometry hardly; else empty.
 */
std::string stampsApart(const DriverInput& odometry, const DriverInput& images);

/**
 * What DriverNode offers the driver in it. One mutex guards all that either of them has. Nothing slow happens while it is held: no
 * file, no image, no wait. Whoever holds it may call actionlib, whose callbacks never take it.
 */
class DriverContext : protected NodeBase
{
public:
  /** `name` as seen from other nodes. */
  std::string resolved(const std::string& name) const
  {
    return nh_.resolveName(name);
  }
  /** The same in quotation marks, for messages. */
  std::string quoted(const std::string& name) const
  {
    return "'" + resolved(name) + "'";
  }
  ros::NodeHandle& nodeHandle()
  {
    return nh_;
  }
  diagnostic_updater::Updater& diagnostics()
  {
    return diagnostics_;
  }

  const CommandGate& gate() const
  {
    return gate_;
  }
  /** Where commands go. */
  std::string commandTopic() const
  {
    return gate_.dryRun() ? "cmd_vel_dry" : "cmd_vel";
  }

  /**
   * Subscribes. @param handler is called with a const Message::ConstPtr& and the mutex held; what it throws ends the goal with the
   * reason.
   */
  template <typename Message, typename Handler>
  void listen(const std::string& topic, std::uint32_t queue_size, Handler handler)
  {
    const std::string what = "a message on '" + resolved(topic) + "'";
    subscribers_.push_back(subscribe<Message>(
        topic, queue_size,
        [this, what, handler](const typename Message::ConstPtr& message) { apply(what, [&] { handler(message); }); },
        ros::TransportHints().tcpNoDelay()));
  }

  /** Runs `body` with the mutex held. What it throws ends the goal: the robot stops, and the reason is published. */
  template <typename Body>
  void apply(const std::string& what, const Body& body)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string fault = guarded(what, body);
    if (!fault.empty())
    {
      abort(what + " failed: " + fault);
    }
  }

  /** Reads something with the mutex held. */
  template <typename Body>
  auto locked(const Body& body)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return body();
  }

  /** An input without which the robot does not move. Called by a driver's constructor; the node keeps it. */
  DriverInput& addInput(const std::string& what, const std::string& topics, double timeout);

  /**
   * Waits until nothing that a goal needs is missing. Only for a driver's prepare(), without the mutex.
   * @param missing see waitUntilReady(); called without the mutex.
   * @throws std::runtime_error with what is missing when it does not come, or when the goal has ended meanwhile.
   */
  void require(const std::function<std::string()>& missing);

  /** Publishes on `~wanted_view` which view the goal that is prepared wants. Only for prepare(), without the mutex. */
  void wantView(const std::string& view);

  /** Id of the goal; empty without one. The mutex is held. */
  virtual std::string goalId() const = 0;
  /** Whether a goal has begun. The mutex is held. */
  virtual bool goalRuns() const = 0;
  /** Stops the robot, then ends the goal, if there is one, without success. The mutex is held. */
  virtual void abort(std::string reason) = 0;

protected:
  DriverContext(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, bool dry_run);
  ~DriverContext() = default;

  /** Whether the goal that is prepared is still wanted. The mutex is held. */
  virtual bool preparing() const = 0;

  /** The view that is wanted while no goal says otherwise; empty: none. */
  void publishWantedView(const std::string& view, const std::string& goal);

  /** What is missing of all inputs, the first that is; empty: nothing. The mutex is held. */
  std::string missingInput() const;

  CommandGate gate_;
  mutable std::mutex mutex_;
  double start_patience_ = START_PATIENCE;
  std::string waiting_for_;  ///< what a goal that is prepared waits for
  std::vector<std::unique_ptr<DriverInput>> inputs_;
  std::vector<ros::Subscriber> subscribers_;

private:
  ros::Publisher wanted_view_publisher_;
};

}  // namespace view_servo
