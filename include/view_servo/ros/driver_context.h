// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/input_watch.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/ros/driver_params.h"
#include "view_servo/ros/live_parameters.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"

#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <ros/transport_hints.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** An input that has to keep coming while the robot moves, such as images. Used with the node's mutex held. */
class DriverInput
{
public:
  /**
   * @param what comes, in words. @param topics it comes on, for messages.
   * @param timeout the robot stands still after so long without it [s].
   */
  DriverInput(std::string what, std::string topics, double timeout)
    : what_(std::move(what)), topics_(std::move(topics)), watch_(timeout)
  {
  }

  /** To be called when something has come that can be used. */
  void accept()
  {
    constexpr double WEIGHT = 0.3;
    constexpr double LONGEST = 0.5;  // [s]
    period_ += WEIGHT * (std::min(watch_.age(), LONGEST) - period_);
    watch_.restart();
    problem_.clear();
    came_ = true;
  }
  /** Whether something that can be used has come, and not too long ago. */
  bool fresh() const
  {
    return came_ && watch_.age() <= timeout();
  }
  /** To be called when something has come that cannot be used. @param problem why, in one line. */
  void reject(const std::string& problem)
  {
    problem_ = problem;
  }
  enum class Stamp
  {
    NEWEST,   ///< newer than all before
    LATE,     ///< a newer one has come before
    UNUSABLE  ///< zero, too old, far in the future, the same as before, or far behind: reject() was called
  };
  /**
   * Checks the stamp of what has come. When time has gone back, as when a bag loops, jump() says so afterwards and the
   * stamp is the newest.
   */
  Stamp checkStamp(const ros::Time& stamp);
  /** Says by how much time has gone back with the stamp checked last; empty when it has not. */
  const std::string& jump() const
  {
    return jump_;
  }
  /** The newest stamp that could be used; zero without any. */
  const ros::Time& newestStamp() const
  {
    return order_.newest();
  }
  /** Forgets which stamps have come: while nobody looked at them, time may have gone back. */
  void forgetStamps()
  {
    order_ = StampOrder();
  }
  /** To be called when a goal begins: the time without input counts from now. */
  void restart()
  {
    watch_.restart();
    problem_.clear();
  }
  /** Sets whether goals need this input; without a call they do. */
  void setNeeded(bool needed)
  {
    needed_ = needed;
  }

  /**
   * Makes the timeout longer for an input that comes slowly: to this many of its usual periods, where that is more than
   * the timeout; periods above 0.5 s count as 0.5 s.
   */
  void followPace(double periods)
  {
    periods_ = periods;
  }

  /** Time without input after which it is missing [s]. followPace() lengthens it only while problem() is empty. */
  double timeout() const
  {
    return problem_.empty() ? std::max(watch_.timeout(), periods_ * period_) : watch_.timeout();
  }

  /**
   * Sets by how much stamps may differ from ROS' time, in the past or in the future [s]. Without a call they may be as
   * old as they like, and up to 600 s in the future.
   */
  void setMaxAge(double age)
  {
    max_age_ = age;
  }

  /** What is missing, in one line; empty: nothing. */
  std::string missing() const;

  /** Time since the last message that can be used, or since the last restart(), whichever was later [s]. */
  double age() const
  {
    return watch_.age();
  }
  /** What comes, in words, as given to the constructor. */
  const std::string& what() const
  {
    return what_;
  }
  /** The topics that it comes on, as given to the constructor. */
  const std::string& topics() const
  {
    return topics_;
  }
  /** Why the last input could not be used; empty when it could. */
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
  StampOrder order_;
  double max_age_ = std::numeric_limits<double>::infinity();  // see setMaxAge() [s]; infinity: it was not called
  double periods_ = 0.0;                                      // see followPace()
  double period_ = 0.0;                                       // mean time between the last inputs [s]
  bool came_ = false;                                         // accept() was called
  bool needed_ = true;                                        // see setNeeded()
};

/**
 * Says how far the newest stamps of odometry and images are apart when this is too far to use them together; else
 * empty.
 */
std::string stampsApart(const DriverInput& odometry, const DriverInput& images);

/**
 * What DriverNode offers its driver. One mutex guards the members of both. Nothing slow happens while it is held: no
 * file is read, no image is worked on, and nobody waits. actionlib may be called with the mutex held, because its
 * callbacks never take it.
 */
class DriverContext : protected NodeBase
{
public:
  /** The name of a topic as other nodes see it. */
  std::string resolved(const std::string& name) const
  {
    return nh_.resolveName(name);
  }
  /** The same in quotation marks, for messages. */
  std::string quoted(const std::string& name) const
  {
    return "'" + resolved(name) + "'";
  }
  /** Of the node: topics and services have names relative to its namespace. */
  ros::NodeHandle& nodeHandle()
  {
    return nh_;
  }
  /** Of the node's parameters, and of names that begin with `~`. */
  const ros::NodeHandle& privateNodeHandle() const
  {
    return private_nh_;
  }
  /** What a driver adds to here is published on `/diagnostics` once a second. */
  diagnostic_updater::Updater& diagnostics()
  {
    return diagnostics_;
  }

  /** Name of the topic that commands go to, before remapping: cmd_vel, or cmd_vel_dry in a dry run. */
  std::string commandTopic() const
  {
    return gate_.dryRun() ? "cmd_vel_dry" : "cmd_vel";
  }

  /**
   * Subscribes. @param handler is called with a const Message::ConstPtr&, by runLocked(). @return the subscriber,
   * which the node keeps.
   */
  template <typename Message, typename Handler>
  ros::Subscriber listen(const std::string& topic, std::uint32_t queue_size, Handler handler)
  {
    return listenEvents<Message>(topic, queue_size, [handler](const ros::MessageEvent<const Message>& event) {
      handler(event.getConstMessage());
    });
  }

  /** Likewise. @param handler is called with a const ros::MessageEvent<const Message>&, which names the publisher. */
  template <typename Message, typename Handler>
  ros::Subscriber listenEvents(const std::string& topic, std::uint32_t queue_size, Handler handler)
  {
    const std::string what = "a message on '" + resolved(topic) + "'";
    subscribers_.push_back(subscribeEvents<Message>(
        topic, queue_size,
        [this, what, handler](const ros::MessageEvent<const Message>& event) {
          runLocked(what, [&] { handler(event); });
        },
        ros::TransportHints().tcpNoDelay()));
    return subscribers_.back();
  }

  /**
   * Runs `body` with the mutex held. If it throws, the goal ends: the robot stops, and the reason is published.
   * @param what is worked on by `body`, in words, for that reason.
   */
  template <typename Body>
  void runLocked(const std::string& what, const Body& body)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string fault = guarded(what, body);
    if (!fault.empty())
    {
      abort(what + " failed: " + fault);
    }
  }

  /** Returns what `body` returns, called with the mutex held. */
  template <typename Body>
  auto locked(const Body& body)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return body();
  }

  /**
   * Adds numbers that people may change while the node runs. For a driver's constructor. @param group its functions are
   * called without the mutex.
   */
  void addLive(LiveGroup group)
  {
    live_groups_.push_back(std::move(group));
  }

  /** Adds an input without which the robot does not move. For a driver's constructor; the node owns the input. */
  DriverInput& addInput(const std::string& what, const std::string& topics, double timeout);

  /**
   * Waits for something that a goal needs before it can begin. Only for a driver's prepare(), without the mutex.
   * @param missing says what is still missing, see waitUntilReady(); called without the mutex.
   * @throws std::runtime_error with what is missing when it has not come within the parameter `start_patience`, or when
   * the goal has ended meanwhile.
   */
  void waitFor(const std::function<std::string()>& missing);

  /** Whether the goal that is being prepared is still wanted. Only for a driver's prepare(), without the mutex. */
  bool isStillWanted()
  {
    return locked([this] { return preparing(); });
  }

  /**
   * Publishes on `~wanted_view` the view of the goal that is being prepared, if that is still wanted. Only for prepare(),
   * without the mutex. @param expect is called just before with the goal's id, with the mutex held.
   */
  void requestView(const std::string& view, const std::function<void(const std::string&)>& expect);

  /** Publishes on `~wanted_view` that the goal goes on to another view, if there is a goal. The mutex is held. */
  void requestNextView(const std::string& view);

  /** Publishes that a view is wanted without a goal, unless there is a goal; empty: none. The mutex is held. */
  void requestIdleView(const std::string& view);

  /** Id of the goal; empty without one. The mutex is held. */
  virtual std::string goalId() const = 0;
  /** Whether there is a goal and it has begun. The mutex is held. */
  virtual bool goalRuns() const = 0;
  /** Stops the robot, then ends the goal, if there is one, without success. The mutex is held. */
  virtual void abort(std::string reason) = 0;

protected:
  DriverContext(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, bool dry_run);
  ~DriverContext() = default;

  /** Whether the goal that is being prepared is still wanted. The mutex is held. */
  virtual bool preparing() const = 0;

  /** Publishes which view is wanted, and for which goal; empty: no view, no goal. */
  void publishWantedView(const std::string& view, const std::string& goal);

  /** What the first input with something missing says is missing; empty: nothing is. The mutex is held. */
  std::string missingInput() const;

  CommandGate gate_;
  mutable std::mutex mutex_;
  double start_patience_ = START_PATIENCE;  ///< longest wait of waitFor() [s]
  std::string waiting_for_;                 ///< what the goal that is being prepared waits for, in words
  std::vector<std::unique_ptr<DriverInput>> inputs_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<LiveGroup> live_groups_;

private:
  ros::Publisher wanted_view_publisher_;
};

}  // namespace view_servo
