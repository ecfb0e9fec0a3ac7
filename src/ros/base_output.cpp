// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/base_output.h"

#include "view_servo/ros/base_conversions.h"

#include <geometry_msgs/Twist.h>

#include <cmath>
#include <utility>

namespace view_servo
{
BaseOutput::BaseOutput(ros::NodeHandle& nh, const std::string& command_topic, std::string base_frame)
  : base_frame_(std::move(base_frame)),
    commands_(nh.advertise<geometry_msgs::Twist>(command_topic, 1)),
    stamped_commands_(nh.advertise<geometry_msgs::TwistStamped>(command_topic + "_stamped", 1)),
    headings_(nh.advertise<Heading>("heading", 5)),
    arrows_(nh.advertise<geometry_msgs::PoseStamped>("heading_arrow", 5)),
    view_poses_(nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("view_pose", 5)),
    base_poses_(nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("base_pose", 5))
{
}

void BaseOutput::publish(const BaseVelocity& velocity) const
{
  const geometry_msgs::TwistStamped stamped = toTwistStamped(velocity, ros::Time::now(), base_frame_);
  commands_.publish(stamped.twist);
  stamped_commands_.publish(stamped);
}

void BaseOutput::publish(const HomingReport& report, const std::string& odom_frame, const std::string& view) const
{
  headings_.publish(toHeading(report, base_frame_));
  if (std::isfinite(report.heading))
  {
    arrows_.publish(toHeadingArrow(report, base_frame_));
  }
  if (report.goal_in_odom)
  {
    view_poses_.publish(toViewPose(report, odom_frame));
  }
  if (report.goal_in_odom && report.tracked)  // while the view is not seen, odometry alone says where the base is
  {
    base_poses_.publish(toBasePose(report, view));
  }
}

bool BaseOutput::hasListener() const
{
  return commands_.getNumSubscribers() + stamped_commands_.getNumSubscribers() > 0;
}

}  // namespace view_servo
