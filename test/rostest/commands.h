// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo::test
{
inline bool moves(const geometry_msgs::Twist& twist)
{
  const auto is_zero = [](const geometry_msgs::Vector3& v) {
    return v.x == 0.0 && v.y == 0.0 && v.z == 0.0;
  };
  return !is_zero(twist.linear) || !is_zero(twist.angular);
}

inline bool moves(const geometry_msgs::TwistStamped& message)
{
  return moves(message.twist);
}

/** The larger one of speed [m/s] and turn rate [rad/s]. */
inline double speedOf(const geometry_msgs::Twist& twist)
{
  const auto norm = [](const geometry_msgs::Vector3& v) {
    return std::hypot(v.x, std::hypot(v.y, v.z));
  };
  return std::max(norm(twist.linear), norm(twist.angular));
}

inline double speedOf(const geometry_msgs::TwistStamped& message)
{
  return speedOf(message.twist);
}

/** The commands of a topic, with when they came. */
template <typename Message>
class CommandsOf
{
public:
  using Clock = std::chrono::steady_clock;

  explicit CommandsOf(const std::string& topic)
  {
    subscriber_ = ros::NodeHandle().subscribe<Message>(topic, 100, &CommandsOf::onMessage, this);
  }

  /** Whether the newest one moves the robot. */
  bool moving() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return !list_.empty() && moves(list_.back().message);
  }
  bool any() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return !list_.empty();
  }
  bool all(const std::function<bool(const Message&)>& predicate) const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::all_of(list_.begin(), list_.end(), [&](const Command& command) { return predicate(command.message); });
  }
  /** When the last one came that moves the robot, since a moment [s]; negative: none did. */
  double lastMotionAfter(Clock::time_point moment) const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto command = list_.rbegin(); command != list_.rend(); ++command)
    {
      if (moves(command->message))
      {
        return std::chrono::duration<double>(command->time - moment).count();
      }
    }
    return -1.0;
  }
  /** The largest speed or turn rate commanded since a moment [m/s, rad/s]. */
  double fastestAfter(Clock::time_point moment) const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    double fastest = 0.0;
    for (auto command = list_.rbegin(); command != list_.rend() && command->time > moment; ++command)
    {
      fastest = std::max(fastest, speedOf(command->message));
    }
    return fastest;
  }
  Message first() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return list_.front().message;
  }
  Message last() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return list_.back().message;
  }

  /** The newest one; one that moves nothing when there is none. */
  Message newest() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return list_.empty() ? Message() : list_.back().message;
  }

  /** Does not listen any more. */
  void shutdown()
  {
    subscriber_.shutdown();
    const std::lock_guard<std::mutex> lock(mutex_);
    list_.clear();
  }

private:
  struct Command
  {
    Clock::time_point time;
    Message message;
  };

  void onMessage(const typename Message::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    list_.push_back({ Clock::now(), *message });
  }

  mutable std::mutex mutex_;
  std::vector<Command> list_;
  ros::Subscriber subscriber_;
};

}  // namespace view_servo::test
