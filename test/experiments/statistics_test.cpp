// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/statistics.h"

#include <gtest/gtest.h>

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

}  // namespace view_servo
