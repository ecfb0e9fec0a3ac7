// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check_ros/commander.h"

#include "check_ros/camera_listener.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/readiness.h"

#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/this_node.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

namespace view_servo::check
{
namespace
{
constexpr double CYCLE = 0.02;  // [s]

void sleepUntil(double time)
{
  const double remaining = time - steadySeconds();
  if (remaining > 0.0)
  {
    std::this_thread::sleep_for(std::chrono::duration<double>(remaining));
  }
}

}  // namespace

Commander::Commander(const ros::NodeHandle& nh, const Setup& setup, const std::string& camera_frame)
  : is_arm_(setup.is_arm), frame_(is_arm_ ? camera_frame : setup.fixedFrame())
{
  ros::NodeHandle topics_nh(nh);
  const std::string topic = setup.commandTopic();
  if (is_arm_)
  {
    using Event = ros::MessageEvent<const geometry_msgs::TwistStamped>;
    publisher_ = topics_nh.advertise<geometry_msgs::TwistStamped>(topic, 1);
    const boost::function<void(const Event&)> callback = [this](const Event& e) {
      onCommand(e.getPublisherName());
    };
    subscriber_ = topics_nh.subscribe<geometry_msgs::TwistStamped>(topic, 1, callback);
  }
  else
  {
    using Event = ros::MessageEvent<const geometry_msgs::Twist>;
    publisher_ = topics_nh.advertise<geometry_msgs::Twist>(topic, 1);
    stamped_publisher_ = topics_nh.advertise<geometry_msgs::TwistStamped>(STAMPED_COMMANDS, 1);
    const boost::function<void(const Event&)> callback = [this](const Event& e) {
      onCommand(e.getPublisherName());
    };
    subscriber_ = topics_nh.subscribe<geometry_msgs::Twist>(topic, 1, callback);
    using StampedEvent = ros::MessageEvent<const geometry_msgs::TwistStamped>;
    const boost::function<void(const StampedEvent&)> stamped_callback = [this](const StampedEvent& e) {
      onCommand(e.getPublisherName());
    };
    stamped_subscriber_ = topics_nh.subscribe<geometry_msgs::TwistStamped>(STAMPED_COMMANDS, 1, stamped_callback);
  }
}

Commander::~Commander()
{
  sendZeros();
}

void Commander::onCommand(const std::string& publisher)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  rival_ = publisher == ros::this_node::getName() ? rival_ : publisher;
}

std::string Commander::rival() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return rival_;
}

std::string Commander::connect(const std::function<bool()>& given_up)
{
  constexpr double PATIENCE = 5.0;        // [s]
  constexpr std::uint32_t OURSELVES = 1;  // subscriber_, stamped_subscriber_
  return waitUntilReady(
      PATIENCE,
      [&] {
        const bool somebody = publisher_.getNumSubscribers() > OURSELVES ||
                              (!is_arm_ && stamped_publisher_.getNumSubscribers() > OURSELVES);
        return somebody ? "" : "nobody listens on '" + publisher_.getTopic() + "'";
      },
      given_up);
}

void Commander::publish(const Twist& velocity)
{
  geometry_msgs::TwistStamped message;
  message.header.stamp = ros::Time::now();
  message.header.frame_id = frame_;
  message.twist.linear = toMessage(velocity.head<3>());
  message.twist.angular = toMessage(velocity.tail<3>());
  if (is_arm_)
  {
    publisher_.publish(message);
    return;
  }
  publisher_.publish(message.twist);
  stamped_publisher_.publish(message);
}

void Commander::sendZeros()
{
  StopBurst burst;
  publish(Twist::Zero());
  burst.sent(true);
  for (double time = steadySeconds() + CYCLE; burst.due(); time += CYCLE)
  {
    sleepUntil(time);
    publish(Twist::Zero());
    burst.sent(true);
  }
}

std::string Commander::drive(const Twist& way, const std::function<std::string()>& objection)
{
  std::string fault;
  try
  {
    fault = follow(way, objection);
  }
  catch (...)
  {
    sendZeros();
    throw;
  }
  sendZeros();
  return fault;
}

std::string Commander::follow(const Twist& way, const std::function<std::string()>& objection)
{
  const bool turns = way.head<3>().isZero();
  const double length = way.norm();
  const double max_speed = turns ? TEST_LIMITS.max_turn_rate : TEST_LIMITS.max_speed;
  const double deceleration = turns ? TEST_LIMITS.max_turn_acceleration : TEST_LIMITS.max_acceleration;
  const double patience = 3.0 * length / max_speed + 2.0;  // [s]
  TwistLimiter limiter(TEST_LIMITS);
  const double begin = steadySeconds();
  double last = begin;
  double done = 0.0;
  double speed = 0.0;
  for (double time = begin; done < length; time += CYCLE)
  {
    sleepUntil(time);
    const double now = steadySeconds();
    done += speed * (now - last);
    last = now;
    std::string fault = objection();
    fault = fault.empty() && !rival().empty() ? rival() + " commands the robot, too" : fault;
    fault = fault.empty() && now - begin > patience ? "it took too long" : fault;
    if (!fault.empty())
    {
      return fault;
    }
    const double slowest = 0.1 * max_speed;
    const double wanted =
        std::min(max_speed, std::max(slowest, std::sqrt(2.0 * deceleration * std::max(0.0, length - done))));
    const Twist velocity = limiter.next(way / length * wanted, CYCLE);
    speed = velocity.norm();
    publish(velocity);
  }
  return "";
}

}  // namespace view_servo::check
