// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/view_choice.h"

#include <gtest/gtest.h>

#include <string>

namespace view_servo
{
namespace
{
WantedView wanted(const std::string& view, const std::string& goal, double stamp)
{
  WantedView message;
  message.header.stamp = ros::Time(stamp);
  message.view = view;
  message.goal = goal;
  return message;
}

void expectChosen(const ViewChoice& choice, const std::string& view, const std::string& goal)
{
  EXPECT_EQ(choice.chosen().view, view);
  EXPECT_EQ(choice.chosen().goal, goal);
}

TEST(ViewChoice, TheNewestCounts)
{
  ViewChoice choice;
  expectChosen(choice, "", "");
  choice.choose("door");
  expectChosen(choice, "door", "");
  EXPECT_TRUE(choice.want(wanted("wall", "1", 1.0)));
  expectChosen(choice, "wall", "1");
  choice.choose("door");
  expectChosen(choice, "door", "");
  EXPECT_TRUE(choice.want(wanted("wall", "2", 2.0)));
  EXPECT_TRUE(choice.want(wanted("wall", "3", 2.0)));
  expectChosen(choice, "wall", "3");
  choice.choose("");
  expectChosen(choice, "", "");
}

TEST(ViewChoice, ADriverEndsOnlyWhatADriverChose)
{
  ViewChoice choice;
  EXPECT_FALSE(choice.want(wanted("", "", 1.0)));
  choice.choose("door");
  EXPECT_FALSE(choice.want(wanted("", "", 2.0)));
  expectChosen(choice, "door", "");
  EXPECT_TRUE(choice.want(wanted("wall", "1", 3.0)));
  EXPECT_TRUE(choice.want(wanted("", "1", 4.0)));
  expectChosen(choice, "", "");
  choice.choose("door");
  EXPECT_FALSE(choice.want(wanted("", "", 5.0)));
  expectChosen(choice, "door", "");
}

TEST(ViewChoice, ALatchedMessageThatComesAgainSaysNothingNew)
{
  ViewChoice choice;
  EXPECT_TRUE(choice.want(wanted("wall", "1", 1.0)));
  choice.choose("door");
  EXPECT_FALSE(choice.want(wanted("wall", "1", 1.0)));
  expectChosen(choice, "door", "");
  EXPECT_TRUE(choice.want(wanted("wall", "1", 1.5)));
  expectChosen(choice, "wall", "1");
}

}  // namespace
}  // namespace view_servo
