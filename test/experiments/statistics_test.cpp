// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace view_servo
{
TEST(Statistics, MeanAndDeviationAreThoseOfTheValues)
{
  const std::vector<double> values{ 2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0 };
  EXPECT_DOUBLE_EQ(mean(values), 5.0);
  EXPECT_DOUBLE_EQ(deviation(values), 2.0);
  EXPECT_EQ(deviation({ 3.0 }), 0.0);
}

TEST(Statistics, PercentilesAreValues)
{
  const std::vector<double> values{ 5.0, 1.0, 4.0, 2.0, 3.0 };
  EXPECT_EQ(percentile(values, 0.0), 1.0);
  EXPECT_EQ(percentile(values, 0.5), 3.0);
  EXPECT_EQ(percentile(values, 0.79), 4.0);
  EXPECT_EQ(percentile(values, 0.8), 5.0);
  EXPECT_EQ(percentile(values, 1.0), 5.0);
}

TEST(Statistics, TheMedianOfAnEvenNumberIsTheLargerInTheMiddle)
{
  EXPECT_EQ(median({ 3.0 }), 3.0);
  EXPECT_EQ(median({ 4.0, 1.0, 3.0, 2.0 }), 3.0);
}

TEST(Statistics, NaNIsLargerThanAnyNumber)
{
  constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(median({ NONE, 2.0, 1.0 }), 2.0);
  EXPECT_TRUE(std::isnan(median({ NONE, 1.0, NONE })));
  EXPECT_TRUE(std::isnan(percentile({ NONE, std::numeric_limits<double>::infinity(), 1.0 }, 1.0)));
}

}  // namespace view_servo
