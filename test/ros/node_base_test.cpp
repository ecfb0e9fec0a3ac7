// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/node_base.h"

#include <gtest/gtest.h>
#include <ros/time.h>

#include <stdexcept>

namespace view_servo
{
namespace
{
TEST(Guarded, SaysWhatWentWrong)
{
  ros::Time::init();
  EXPECT_EQ(guarded("a message", [] { throw std::runtime_error("no camera"); }), "no camera");
  EXPECT_EQ(guarded("a message", [] { throw std::runtime_error(""); }), "an exception without a text");
  EXPECT_EQ(guarded("a message", [] { throw 1; }), "unknown exception");
  EXPECT_EQ(guarded("a message", [] {}), "");
}

}  // namespace
}  // namespace view_servo
