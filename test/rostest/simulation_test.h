// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "sim_ros/robot_messages.h"

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <Eigen/Geometry>

#include <string>

namespace view_servo::sim
{
/** What the tests of simulated robots share: `State` is what the robot's sensors tell, `Command` what it obeys. */
template <typename State, typename Command>
class SimulationTest : public testing::Test
{
protected:
  /** @param base the frame in which cameraByTf() is. */
  SimulationTest(const std::string& state_topic, const std::string& base)
    : state_(state_topic), listener_(tf_), command_(nh_.advertise<Command>("cmd_vel", 1)), base_(base)
  {
  }

  /** Until all that the robot publishes has come, and it takes commands. */
  void waitForRobot()
  {
    ASSERT_TRUE(test::waitUntil([&] { return images_.last() && truth_.last() && state_.last(); }));
    ASSERT_TRUE(test::waitUntil([&] { return command_.getNumSubscribers() > 0; }));
  }

  void waitForFreshTruth()
  {
    const ros::Time now = ros::Time::now();
    ASSERT_TRUE(
        test::waitUntil([&] { return truth_.last()->header.stamp > now && state_.last()->header.stamp > now; }));
  }

  /** The camera's pose in the base frame, by tf. */
  Eigen::Isometry3d cameraByTf(const ros::Time& stamp)
  {
    const geometry_msgs::Transform transform =
        tf_.lookupTransform(base_, CAMERA_FRAME, stamp, ros::Duration(2.0)).transform;
    geometry_msgs::Pose pose;
    pose.position.x = transform.translation.x;
    pose.position.y = transform.translation.y;
    pose.position.z = transform.translation.z;
    pose.orientation = transform.rotation;
    return toIsometry(pose);
  }

  Eigen::Isometry3d cameraByTruth() const
  {
    return toIsometry(truth_.last()->pose);
  }

  ros::NodeHandle nh_;
  test::Recorder<State> state_;
  test::Recorder<geometry_msgs::PoseStamped> truth_{ "ground_truth" };
  test::Recorder<sensor_msgs::Image> images_{ "camera/image_raw" };
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener listener_;
  ros::Publisher command_;

private:
  const std::string base_;
};

}  // namespace view_servo::sim
