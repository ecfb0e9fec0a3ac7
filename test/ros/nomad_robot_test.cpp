// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/nomad_robot.h"

#include <gtest/gtest.h>

#include <string>

namespace view_servo::sim
{
namespace
{
/** An empty floor; the camera is before the axle. */
World emptyWorld()
{
  World world;
  world.camera_on_base.translation() << 0.15, 0.0, 0.9;
  world.camera_on_base.linear() << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  return world;
}

/** By a transform, the place of the child's origin in its parent, and that both have these names. */
Eigen::Vector3d placeIn(const geometry_msgs::TransformStamped& transform, const std::string& parent,
                        const std::string& child)
{
  EXPECT_EQ(transform.header.frame_id, parent);
  EXPECT_EQ(transform.child_frame_id, child);
  const auto& place = transform.transform.translation;
  return { place.x, place.y, place.z };
}

/** Drives one metre ahead. */
void driveOneMetre(NomadRobot& robot)
{
  Robot::Twist ahead = Robot::Twist::Zero();
  ahead(0) = 0.5;
  robot.command(ahead);
  while (robot.nomad().odometry().translation().x() < 1.0)
  {
    robot.step(0.01);
  }
}

}  // namespace

TEST(NomadRobot, TellsOfBaseLinkOnTheFloor)
{
  const World world = emptyWorld();
  NomadRobot robot(world, NomadParams());
  driveOneMetre(robot);
  const SensorMessages messages = robot.readSensors(ros::Time(1));
  const double x = robot.nomad().odometry().translation().x();
  EXPECT_EQ(placeIn(messages.transform, "odom", "base_link"), Eigen::Vector3d(x, 0.0, 0.0));
  EXPECT_EQ(messages.odometry->header.frame_id, "odom");
  EXPECT_EQ(messages.odometry->child_frame_id, "base_link");
  EXPECT_FALSE(robot.footprintMount(ros::Time(1)));
  EXPECT_EQ(placeIn(*robot.cameraMount(ros::Time(1)), "base_link", "camera_optical_frame"),
            world.camera_on_base.translation());
}

TEST(NomadRobot, TellsOfAFootprintBelowBaseLink)
{
  const World world = emptyWorld();
  NomadRobot robot(world, NomadParams(), NomadFrames{ "odom_combined", "base_footprint", 0.1 });
  driveOneMetre(robot);
  const SensorMessages messages = robot.readSensors(ros::Time(1));
  const double x = robot.nomad().odometry().translation().x();
  EXPECT_EQ(placeIn(messages.transform, "odom_combined", "base_footprint"), Eigen::Vector3d(x, 0.0, 0.0));
  EXPECT_EQ(messages.odometry->header.frame_id, "odom_combined");
  EXPECT_EQ(messages.odometry->child_frame_id, "base_footprint");
  EXPECT_EQ(messages.odometry->pose.pose.position.x, x);
  EXPECT_EQ(placeIn(robot.footprintMount(ros::Time(1)).value(), "base_footprint", "base_link"),
            Eigen::Vector3d(0.0, 0.0, 0.1));
  const Eigen::Vector3d camera = placeIn(*robot.cameraMount(ros::Time(1)), "base_link", "camera_optical_frame");
  EXPECT_TRUE(camera.isApprox(Eigen::Vector3d(0.15, 0.0, 0.8)));
}

TEST(NomadRobot, OdometryOfARaisedBaseLinkIsAsHigh)
{
  const World world = emptyWorld();
  NomadRobot robot(world, NomadParams(), NomadFrames{ "odom", "", 0.1 });
  const SensorMessages messages = robot.readSensors(ros::Time(1));
  EXPECT_EQ(placeIn(messages.transform, "odom", "base_link"), Eigen::Vector3d(0.0, 0.0, 0.1));
  EXPECT_EQ(messages.odometry->pose.pose.position.z, 0.1);
}

TEST(NomadNodeParams, RefusesABaseLinkBelowTheFloor)
{
  NomadNodeParams params;
  EXPECT_TRUE(params.validate().empty());
  params.frames.base_link_height = -0.1;
  params.radius = 0.0;
  ASSERT_EQ(params.validate().size(), 2U);
  EXPECT_NE(params.validate()[1].find("base_link_height"), std::string::npos);
}

}  // namespace view_servo::sim
