// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/quantile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace view_servo
{
TEST(Quantile, QuantilesAreValues)
{
  const std::vector<double> values{ 5.0, 1.0, 4.0, 2.0, 3.0 };
  EXPECT_EQ(quantileOf(values, 0.0), 1.0);
  EXPECT_EQ(quantileOf(values, 0.5), 3.0);
  EXPECT_EQ(quantileOf(values, 0.79), 4.0);
  EXPECT_EQ(quantileOf(values, 0.8), 5.0);
  EXPECT_EQ(quantileOf(values, 1.0), 5.0);
}

TEST(Quantile, TheMedianOfAnEvenNumberIsTheLargerInTheMiddle)
{
  EXPECT_EQ(medianOf({ 3.0 }), 3.0);
  EXPECT_EQ(medianOf({ 4.0, 1.0, 3.0, 2.0 }), 3.0);
}

TEST(Quantile, NaNIsLargerThanAnyNumber)
{
  constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(medianOf({ NONE, 2.0, 1.0 }), 2.0);
  EXPECT_TRUE(std::isnan(medianOf({ NONE, 1.0, NONE })));
  EXPECT_TRUE(std::isnan(quantileOf({ NONE, std::numeric_limits<double>::infinity(), 1.0 }, 1.0)));
}

}  // namespace view_servo
