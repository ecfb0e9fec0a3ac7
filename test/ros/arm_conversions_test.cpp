// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/arm_conversions.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double INFINITE = std::numeric_limits<double>::infinity();

Homography example()
{
  Homography message;
  message.header.stamp = ros::Time(12.5);
  message.valid = 1;
  message.inliers = 40;
  message.rotation.w = 1.0;
  message.translation_over_distance.x = 0.2;
  message.normal.z = 1.0;
  message.distance = 0.5;
  return message;
}

TEST(PlaneView, SaysWhatTheHomographyDoes)
{
  const PlaneView view = toPlaneView(example());
  EXPECT_EQ(view.stamp, 12.5);
  EXPECT_EQ(view.inliers, 40);
  EXPECT_TRUE(view.motion.rotation.isIdentity());
  EXPECT_EQ(view.motion.translation_over_distance, Eigen::Vector3d(0.2, 0.0, 0.0));
  EXPECT_EQ(view.motion.normal, Eigen::Vector3d(0.0, 0.0, 1.0));
  EXPECT_EQ(view.distance, 0.5);
}

TEST(PlaneView, IsWithoutWhatIsNotKnownYet)
{
  Homography message = example();
  message.distance = message.normal.x = message.normal.y = message.normal.z = NOT_A_NUMBER;
  const PlaneView view = toPlaneView(message);
  EXPECT_FALSE(view.distance);
  EXPECT_EQ(view.motion.normal, Eigen::Vector3d(0.0, 0.0, 1.0));
}

TEST(PlaneView, RefusesNumbersOutsideTheirRange)
{
  const std::vector<std::pair<std::string, std::function<void(Homography&, double)>>> fields = {
    { "rotation",
      [](Homography& m, double x) {
        m.rotation.w = x;
      } },
    { "t / d",
      [](Homography& m, double x) {
        m.translation_over_distance.y = x;
      } },
    { "normal",
      [](Homography& m, double x) {
        m.normal.x = x;
      } },
    { "distance",
      [](Homography& m, double x) {
        m.distance = x;
      } },
  };
  for (const auto& [name, set] : fields)
  {
    for (const double number : { INFINITE, -INFINITE, 1e300, -1e300, 1e7 })
    {
      SCOPED_TRACE(name + " " + std::to_string(number));
      Homography message = example();
      set(message, number);
      try
      {
        toPlaneView(message);
        ADD_FAILURE() << "it is taken";
      }
      catch (const std::runtime_error& error)
      {
        EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
      }
    }
  }
  for (const double distance : { 0.0, -1.0, 1e-7 })
  {
    Homography message = example();
    message.distance = distance;
    EXPECT_THROW(toPlaneView(message), std::runtime_error) << distance;
  }
  Homography message = example();
  message.rotation.w = NOT_A_NUMBER;
  EXPECT_THROW(toPlaneView(message), std::runtime_error);
  message = example();
  message.rotation.w = 0.0;
  EXPECT_THROW(toPlaneView(message), std::runtime_error);
  message = example();
  message.inliers = -1;
  EXPECT_THROW(toPlaneView(message), std::runtime_error);
}

TEST(JointLimits, AreThoseOfTheRobot)
{
  EXPECT_TRUE(jointLimits("").empty());
  EXPECT_TRUE(jointLimits("this is no robot").empty());
  const auto limits = jointLimits(R"(<robot name="arm"><link name="a"/><link name="b"/><link name="c"/>
    <joint name="elbow" type="revolute"><parent link="a"/><child link="b"/>
      <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
    <joint name="wheel" type="continuous"><parent link="b"/><child link="c"/></joint></robot>)");
  ASSERT_EQ(limits.size(), 1u);
  EXPECT_EQ(limits.at("elbow").lower, -1.0);
  EXPECT_EQ(limits.at("elbow").upper, 2.0);
}

TEST(JointsMoving, AreThoseBetweenTheLinkAndTheRoot)
{
  const std::string urdf = R"(<robot name="arm"><link name="a"/><link name="b"/><link name="c"/><link name="finger"/>
    <link name="camera"/>
    <joint name="elbow" type="revolute"><parent link="a"/><child link="b"/>
      <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
    <joint name="wrist" type="continuous"><parent link="b"/><child link="c"/></joint>
    <joint name="mount" type="fixed"><parent link="c"/><child link="camera"/></joint>
    <joint name="grip" type="prismatic"><parent link="c"/><child link="finger"/>
      <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint></robot>)";
  const std::set<std::string> arm{ "elbow", "wrist" };
  EXPECT_EQ(jointsMoving(urdf, "camera"), arm);
  EXPECT_EQ(jointsMoving(urdf, "/camera"), arm);
  EXPECT_EQ(jointsMoving(urdf, "left/camera"), arm);
  EXPECT_EQ(jointsMoving(urdf, "finger").count("grip"), 1U);
  EXPECT_TRUE(jointsMoving(urdf, "elsewhere").empty());
  EXPECT_TRUE(jointsMoving("", "camera").empty());
}

}  // namespace
}  // namespace view_servo
