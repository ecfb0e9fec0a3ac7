// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/** @file A simulated base in the desk's room, with view_store, a matcher and homing: see learning.test. */
#include "node_test.h"

#include "view_servo/SaveView.h"
#include "view_servo/WantedView.h"
#include "view_servo/ros/call_service.h"

#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Image.h>

#include <cmath>
#include <string>

namespace view_servo
{
namespace test
{
class SimulatedBaseTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    ASSERT_TRUE(waitForService("view_store/save"));
    ASSERT_TRUE(waitUntil([this] { return odometry_.last() && images_.last() && commands_.getNumSubscribers() > 0; }));
  }

  void TearDown() override
  {
    removeViews("homing");
  }

  geometry_msgs::Point position() const
  {
    return odometry_.last()->pose.pose.position;
  }

  static double distance(const geometry_msgs::Point& a, const geometry_msgs::Point& b)
  {
    return std::hypot(a.x - b.x, a.y - b.y);
  }

  /** Drives back until the base is so far from where it was [m]. */
  bool driveBack(double wanted)
  {
    const geometry_msgs::Point start = position();
    const bool there = waitUntil([&] { return distance(position(), start) >= wanted; },
                                 [&] {
                                   geometry_msgs::Twist twist;
                                   twist.linear.x = -0.1;
                                   commands_.publish(twist);
                                 });
    commands_.publish(geometry_msgs::Twist());
    return there;
  }

  /** @return what view_store said. */
  static std::string save(const std::string& name, bool learn = false)
  {
    SaveView service;
    service.request.name = name;
    service.request.learn = learn;
    EXPECT_TRUE(callService("view_store/save", service) && service.response.success) << service.response.message;
    return service.response.message;
  }

  ros::NodeHandle nh_;
  Recorder<nav_msgs::Odometry> odometry_{ "odom" };
  Recorder<sensor_msgs::Image> images_{ "camera/image_raw" };
  Recorder<WantedView> wanted_{ "homing/wanted_view" };
  ros::Publisher commands_ = nh_.advertise<geometry_msgs::Twist>("cmd_vel", 1);
};

}  // namespace test
}  // namespace view_servo
