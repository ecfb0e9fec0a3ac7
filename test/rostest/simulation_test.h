// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "sim_ros/robot_messages.h"
#include "support/program_run.h"

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <Eigen/Geometry>

#include <functional>
#include <string>
#include <vector>

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

  /** Each test begins with the robot ready and at rest, and with messages that say so. */
  void SetUp() final
  {
    waitForRobot();
    ASSERT_FALSE(HasFatalFailure());
    prepare();
    ASSERT_FALSE(HasFatalFailure());
    ASSERT_TRUE(test::waitUntil([&] { return speed() == 0.0; }));
    waitForFreshTruth();
  }

  /** What a test needs besides, once the robot is there: places it, or waits for more of its messages. */
  virtual void prepare() = 0;

  /** How fast the robot is by its state; 0 only when all of it stands. */
  virtual double speedOf(const State& state) const = 0;

  double speed() const
  {
    return speedOf(*state_.last());
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

  /** How the camera moves while `move` is commanded until it is so far away [m]: by the truth, and by tf. */
  struct Motions
  {
    Eigen::Isometry3d by_truth;
    Eigen::Isometry3d by_tf;
  };
  Motions motionsWhile(const std::function<void()>& move, double distance)
  {
    const geometry_msgs::PoseStamped start = *truth_.last();
    const Eigen::Isometry3d tf_start = cameraByTf(start.header.stamp);
    const Eigen::Vector3d from = cameraByTruth().translation();
    EXPECT_TRUE(test::waitUntil([&] { return (cameraByTruth().translation() - from).norm() > distance; }, move));
    waitForFreshTruth();
    const geometry_msgs::PoseStamped end = *truth_.last();
    EXPECT_EQ(end.header.frame_id, "world");
    return { toIsometry(start.pose).inverse() * toIsometry(end.pose),
             tf_start.inverse() * cameraByTf(end.header.stamp) };
  }

  /** Commands `move` until the robot is so fast, and no more: it must stand within a quarter of a second. */
  void expectToStandAfter(const std::function<void()>& move, double fast)
  {
    ASSERT_TRUE(test::waitUntil([&] { return speed() > fast; }, move));
    move();
    const ros::WallTime last = ros::WallTime::now();
    ASSERT_TRUE(test::waitUntil([&] { return speed() == 0.0; }));
    // Its own stamp says when it stood, however late the message came.
    for (const State& state : state_.messages())
    {
      const double after = state.header.stamp.toSec() - last.toSec();
      if (after > 0.25)
      {
        EXPECT_EQ(speedOf(state), 0.0) << after << " s after the last command";
      }
    }
  }

  /** Commands `move` until that much time has passed on the robot's stamps [s]. */
  void moveFor(double duration, const std::function<void()>& move)
  {
    const ros::Time end = ros::Time::now() + ros::Duration(duration);
    ASSERT_TRUE(test::waitUntil([&] { return state_.last()->header.stamp > end; }, move));
  }

  /** The node's program must end with status 1 when it is started with these arguments. */
  static void expectRefusedStart(const std::string& program, const std::vector<std::string>& arguments)
  {
    std::vector<std::string> all{ "__name:=refused" };
    all.insert(all.end(), arguments.begin(), arguments.end());
    EXPECT_EQ(test::runProgram(program, all).status, 1) << arguments.back();
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
