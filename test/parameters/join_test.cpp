// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/join.h"

#include <gtest/gtest.h>

namespace view_servo
{
TEST(Join, PutsTheSeparatorBetweenTexts)
{
  EXPECT_EQ(join({}, ", "), "");
  EXPECT_EQ(join({ "a" }, ", "), "a");
  EXPECT_EQ(join({ "a", "b", "c" }, ", "), "a, b, c");
  EXPECT_EQ(join({ "", "b", "" }, ", "), ", b, ");
}

}  // namespace view_servo
