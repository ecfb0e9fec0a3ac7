// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/transform_source.h"

#include <gtest/gtest.h>

#include <string>

namespace view_servo
{
namespace
{
TEST(StampOrder, TellsLateMessagesFromTimeThatGoesBack)
{
  StampOrder order;
  EXPECT_EQ(order.check(ros::Time(10.0)), StampOrder::NEWEST);
  EXPECT_EQ(order.check(ros::Time(10.2)), StampOrder::NEWEST);
  EXPECT_EQ(order.check(ros::Time(10.2)), StampOrder::REPEATED);
  EXPECT_EQ(order.check(ros::Time(10.1)), StampOrder::LATE);
  EXPECT_NEAR(order.behind(), 0.1, 1e-6);
  EXPECT_EQ(order.newest(), ros::Time(10.2));
  EXPECT_EQ(order.check(ros::Time(8.0)), StampOrder::FAR_LATE);
  EXPECT_EQ(order.check(ros::Time(8.1)), StampOrder::FAR_LATE);
  EXPECT_EQ(order.newest(), ros::Time(10.2));
  EXPECT_EQ(order.check(ros::Time(8.2)), StampOrder::GONE_BACK);
  EXPECT_NEAR(order.behind(), 2.0, 1e-6);
  EXPECT_EQ(order.newest(), ros::Time(8.2));
  EXPECT_EQ(order.check(ros::Time(8.3)), StampOrder::NEWEST);
}

TEST(StampOrder, TwoPublishersThatTakeTurnsAreNoTimeThatGoesBack)
{
  StampOrder order;
  for (int i = 0; i < 50; ++i)
  {
    EXPECT_EQ(order.check(ros::Time(10.0 + 0.1 * i)), StampOrder::NEWEST);
    EXPECT_EQ(order.check(ros::Time(5.0 + 0.1 * i)), StampOrder::FAR_LATE);
  }
}

TEST(StampOrder, TheFirstStampIsTheNewestWhateverItIs)
{
  StampOrder order;
  EXPECT_TRUE(order.newest().isZero());
  EXPECT_EQ(order.check(ros::Time(0, 1)), StampOrder::NEWEST);
}

TEST(DriverInput, SaysWhatIsWrongWithAStamp)
{
  ros::Time::init();
  const ros::Time now = ros::Time::now();
  DriverInput input("odometry", "'/odom'", 0.25);
  EXPECT_EQ(input.checkStamp(ros::Time()), DriverInput::Stamp::UNUSABLE);
  EXPECT_NE(input.problem().find("no stamp"), std::string::npos);
  EXPECT_EQ(input.checkStamp(now + ros::Duration(3600.0)), DriverInput::Stamp::UNUSABLE);
  EXPECT_NE(input.problem().find("in the future"), std::string::npos);
  EXPECT_EQ(input.checkStamp(now), DriverInput::Stamp::NEWEST);
  EXPECT_EQ(input.checkStamp(now), DriverInput::Stamp::UNUSABLE);
  EXPECT_NE(input.problem().find("stand still"), std::string::npos);
  EXPECT_EQ(input.checkStamp(now - ros::Duration(0.1)), DriverInput::Stamp::LATE);
  for (int i = 0; i < 2; ++i)
  {
    EXPECT_EQ(input.checkStamp(now - ros::Duration(2.0)), DriverInput::Stamp::UNUSABLE);
    EXPECT_NE(input.problem().find("stamped 2 s before another"), std::string::npos) << input.problem();
    EXPECT_EQ(input.jump(), "");
  }
  EXPECT_EQ(input.checkStamp(now - ros::Duration(2.0)), DriverInput::Stamp::NEWEST);
  EXPECT_EQ(input.jump(), "time has gone back by 2 s in odometry on '/odom'");
  EXPECT_EQ(input.checkStamp(now), DriverInput::Stamp::NEWEST);
  EXPECT_EQ(input.jump(), "");
}

TEST(WithoutSlash, IsTheNameThatTfKnows)
{
  EXPECT_EQ(withoutSlash("/base_link"), "base_link");
  EXPECT_EQ(withoutSlash("robot1/base_link"), "robot1/base_link");
  EXPECT_EQ(withoutSlash(""), "");
  EXPECT_EQ(withoutSlash("/"), "");
}

}  // namespace
}  // namespace view_servo
