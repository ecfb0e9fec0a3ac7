// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/driver_context.h"

#include "view_servo/WantedView.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
DriverInput::Stamp DriverInput::checkStamp(const ros::Time& stamp)
{
  constexpr double MAX_AHEAD = 600.0;  // of ROS' clock: clocks may be apart, but no clock says more [s]
  jump_.clear();
  const std::string name = what_ + " on " + topics_;
  if (stamp.isZero())
  {
    reject(name + ": no stamp, it is all zero");
    return Stamp::UNUSABLE;
  }
  const double age = ageOf(stamp);
  if (age > max_age_)
  {
    reject(name + ": stamped " + seconds(age) + " ago, at most " + seconds(max_age_) + " are allowed" +
           remedyOfAge(age));
    return Stamp::UNUSABLE;
  }
  if (-age > std::min(max_age_, MAX_AHEAD))
  {
    reject(name + ": stamped " + seconds(-age) + " in the future");
    return Stamp::UNUSABLE;
  }
  switch (order_.check(stamp))
  {
    case StampOrder::REPEATED:
      reject(name + ": stamps stand still");
      return Stamp::UNUSABLE;
    case StampOrder::FAR_LATE:
      reject(name + ": a message is stamped " + seconds(order_.behind()) + " before another that came earlier");
      return Stamp::UNUSABLE;
    case StampOrder::LATE:
      return Stamp::LATE;
    case StampOrder::GONE_BACK:
      jump_ = "time has gone back by " + seconds(order_.behind()) + " in " + name;
      break;
    case StampOrder::NEWEST:
      break;
  }
  return Stamp::NEWEST;
}

std::string DriverInput::missing() const
{
  if (!needed_ || age() <= timeout())
  {
    return "";
  }
  return problem_.empty() ? "no " + what_ + " for " + seconds(timeout()) + " on " + topics_ : problem_;
}

std::string stampsApart(const DriverInput& odometry, const DriverInput& images)
{
  constexpr double FAR = 0.45;  // more than images take to come, and homing can bear [s]
  const double ahead = secondsBetween(images.newestStamp(), odometry.newestStamp());
  const bool known = !images.newestStamp().isZero() && !odometry.newestStamp().isZero();
  if (!known || std::abs(ahead) < FAR)
  {
    return "";
  }
  return "odometry on " + odometry.topics() + " is stamped " + seconds(std::abs(ahead)) +
         (ahead > 0.0 ? " after" : " before") + " the images on " + images.topics() +
         ": their clocks are apart, or one comes late";
}

DriverContext::DriverContext(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, bool dry_run)
  : NodeBase(nh, private_nh), gate_(dry_run)
{
  wanted_view_publisher_ = private_nh_.advertise<WantedView>("wanted_view", 1, true);
}

DriverInput& DriverContext::addInput(const std::string& what, const std::string& topics, double timeout)
{
  inputs_.push_back(std::make_unique<DriverInput>(what, topics, timeout));
  return *inputs_.back();
}

void DriverContext::waitFor(const std::function<std::string()>& missing)
{
  const auto ended = [this] {
    return !isStillWanted();
  };
  const auto lacking = [&] {
    std::string what = missing();
    locked([&] { waiting_for_ = preparing() ? what : waiting_for_; });
    return what;
  };
  const std::string what = waitUntilReady(start_patience_, lacking, ended);
  if (!what.empty())
  {
    throw std::runtime_error(what);
  }
  if (ended())
  {
    throw std::runtime_error("the goal has ended");
  }
}

void DriverContext::requestView(const std::string& view, const std::function<void(const std::string&)>& expect)
{
  locked([&] {
    if (preparing())
    {
      expect(goalId());
      publishWantedView(view, goalId());
    }
  });
}

void DriverContext::requestNextView(const std::string& view)
{
  if (!goalId().empty())
  {
    publishWantedView(view, goalId());
  }
}

void DriverContext::requestIdleView(const std::string& view)
{
  if (goalId().empty())
  {
    publishWantedView(view, "");
  }
}

void DriverContext::publishWantedView(const std::string& view, const std::string& goal)
{
  WantedView message;
  message.header.stamp = ros::Time::now();
  message.view = view;
  message.goal = goal;
  wanted_view_publisher_.publish(message);
}

std::string DriverContext::missingInput() const
{
  for (const std::unique_ptr<DriverInput>& input : inputs_)
  {
    std::string missing = input->missing();
    if (!missing.empty())
    {
      return missing;
    }
  }
  return "";
}

}  // namespace view_servo
