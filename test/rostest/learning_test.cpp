// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A view that is saved with learn: true is learnt while the base is driven away from it, and used by the next goal. */
#include "node_test.h"

#include "view_servo/Heading.h"
#include "view_servo/SaveView.h"
#include "view_servo/WantedView.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>

#include <cmath>
#include <filesystem>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
class LearningTest : public ::testing::Test
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

  /** Drives back until the base is so far from where it was. */
  bool driveBack(double distance)
  {
    const geometry_msgs::Point start = odometry_.last()->pose.pose.position;
    const bool there = waitUntil(
        [&] {
          const geometry_msgs::Point now = odometry_.last()->pose.pose.position;
          return std::hypot(now.x - start.x, now.y - start.y) >= distance;
        },
        [&] {
          geometry_msgs::Twist twist;
          twist.linear.x = -0.1;
          commands_.publish(twist);
        });
    commands_.publish(geometry_msgs::Twist());
    return there;
  }

  std::size_t pointsLearnt() const
  {
    return ViewStore(viewsDir("homing")).loadStructure("learnt").points.size();
  }

  ros::NodeHandle nh_;
  Recorder<nav_msgs::Odometry> odometry_{ "odom" };
  Recorder<sensor_msgs::Image> images_{ "camera/image_raw" };
  Recorder<Heading> headings_{ "heading" };
  Recorder<WantedView> wanted_{ "homing/wanted_view" };
  Recorder<geometry_msgs::PoseWithCovarianceStamped> view_pose_{ "view_pose" };
  ros::Publisher commands_ = nh_.advertise<geometry_msgs::Twist>("cmd_vel", 1);
};

TEST_F(LearningTest, LearnsAViewWhileTheBaseIsDrivenAway)
{
  const geometry_msgs::Pose at_view = odometry_.last()->pose.pose;
  SaveView save;
  save.request.name = "learnt";
  save.request.learn = true;
  ASSERT_TRUE(callService("view_store/save", save) && save.response.success) << save.response.message;
  EXPECT_NE(save.response.message.find("it is learnt while the base moves"), std::string::npos)
      << save.response.message;
  ASSERT_TRUE(waitUntil([this] { return wanted_.last() && wanted_.last()->view == "learnt"; }));
  EXPECT_TRUE(wanted_.last()->goal.empty());
  EXPECT_EQ(pointsLearnt(), 0U);
  ASSERT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));

  ASSERT_TRUE(driveBack(0.4));
  EXPECT_TRUE(waitUntil([this] { return pointsLearnt() >= 30; })) << pointsLearnt();
  ASSERT_TRUE(view_pose_.last());
  const geometry_msgs::Point found = view_pose_.last()->pose.pose.position;
  EXPECT_LT(std::hypot(found.x - at_view.position.x, found.y - at_view.position.y), 0.05);
  EXPECT_TRUE(waitUntil([this] { return wanted_.last()->view.empty(); })) << "the lesson is over";
}

TEST_F(LearningTest, SaysNothingOfLearningUnlessAsked)
{
  SaveView save;
  save.request.name = "plain";
  ASSERT_TRUE(callService("view_store/save", save) && save.response.success) << save.response.message;
  EXPECT_EQ(save.response.message.find("learnt"), std::string::npos) << save.response.message;
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "learning_test");
}
