// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/odometry_input.h"

#include "view_servo/parameters/shown_text.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <cmath>
#include <iterator>
#include <utility>

namespace view_servo
{
OdometryReader::OdometryReader(DriverInput& input, const TransformSource& transforms, std::string base_frame,
                               double delay)
  : input_(input), transforms_(transforms), base_frame_(std::move(base_frame)), delay_(delay)
{
}

std::size_t OdometryReader::countPublishers(const std::string& publisher)
{
  constexpr std::chrono::seconds LATELY(1);
  const Clock::time_point now = Clock::now();
  publishers_[publisher] = now;
  for (auto other = publishers_.begin(); other != publishers_.end();)
  {
    other = now - other->second > LATELY ? publishers_.erase(other) : std::next(other);
  }
  return publishers_.size();
}

std::string OdometryReader::faultOf(const nav_msgs::Odometry& message, const PlanarPose& pose, std::size_t publishers)
{
  constexpr double FARTHEST = 1e6;  // [m]
  const std::string name = "odometry on " + input_.topics();
  if (publishers > 1)
  {
    return std::to_string(publishers) + " nodes publish " + name + ": only one may";
  }
  if (!(std::hypot(pose.x, pose.y) < FARTHEST && std::isfinite(pose.yaw)))
  {
    return name + " is no pose within 1000 km";
  }
  const std::string child = withoutSlash(message.child_frame_id);
  if (child != child_frame_)
  {
    child_frame_ = child;
    base_in_child_.reset();
  }
  if (base_in_child_)
  {
    return "";
  }
  if (child.empty() || child == base_frame_)
  {
    base_in_child_ = PlanarPose();
    return "";
  }
  const std::string missing = transforms_.missing(child, base_frame_, ros::Time(0));
  if (!missing.empty())
  {
    return name + " is of '" + shown(child) + "', ~base_frame is '" + base_frame_ + "': " + missing;
  }
  base_in_child_ = toPlanar(toIsometry(transforms_.lookUp(child, base_frame_, ros::Time(0), 0.0).transform));
  return "";
}

std::optional<OdometryReading> OdometryReader::read(const Event& event)
{
  const nav_msgs::Odometry& message = *event.getConstMessage();
  const PlanarPose child_pose = toPlanarPose(message);
  const std::string fault = faultOf(message, child_pose, countPublishers(event.getPublisherName()));
  if (!fault.empty())
  {
    input_.reject(fault);
    return std::nullopt;
  }
  const double time = message.header.stamp.toSec() - delay_;
  const DriverInput::Stamp place =
      input_.checkStamp(message.header.stamp.isZero() ? message.header.stamp : toStamp(time));
  if (place == DriverInput::Stamp::UNUSABLE)
  {
    return std::nullopt;
  }
  input_.accept();
  frame_ = withoutSlash(message.header.frame_id);
  return OdometryReading{ place, time, compose(child_pose, *base_in_child_) };
}

void OdometryReader::setRemainingDelay(double delay)
{
  if (std::isfinite(delay))
  {
    measured_delay_ = delay_ + delay;
  }
}

std::string OdometryReader::adviceOnDelay() const
{
  constexpr double LARGE = 0.05;  // [s]
  if (!(std::abs(measured_delay_ - delay_) >= LARGE))
  {
    return "";
  }
  return "odometry on " + input_.topics() + " is stamped " + seconds(std::abs(measured_delay_)) +
         (measured_delay_ > 0.0 ? " later" : " earlier") + " than images of the same moment: set ~odometry_delay to " +
         seconds(std::round(100.0 * measured_delay_) / 100.0) + ", or synchronise the clocks";
}

OdometryInput::OdometryInput(DriverContext& context, const TransformSource& transforms, const std::string& base_frame,
                             double timeout, double delay, const std::function<void(const Event&)>& on_message)
  : OdometryReader(context.addInput("odometry", context.quoted("odom"), timeout), transforms, base_frame, delay)
{
  context.listenEvents<nav_msgs::Odometry>("odom", 50, on_message);
}

}  // namespace view_servo
