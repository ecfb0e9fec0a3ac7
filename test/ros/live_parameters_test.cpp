// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/live_parameters.h"

#include "view_servo/control/servo_25d.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
Servo25dParams started()
{
  Servo25dParams params;
  params.gain = 1.25;
  params.near_gain = 2.5;
  return params;
}

std::vector<LiveNumber> gains()
{
  Servo25dParams params = started();
  return aroundNow(parameters(params), { "gain", "near_gain" }, { 0.1, 2.0 });
}

TEST(LiveNumbers, AreAllowedWithinASpanOfWhatTheNodeWasStartedWith)
{
  const std::vector<LiveNumber> numbers = gains();
  ASSERT_EQ(numbers.size(), 2U);
  EXPECT_EQ(numbers[0].name, "gain");
  EXPECT_EQ(numbers[0].description, "rate at which a large error decays [1/s]");
  EXPECT_DOUBLE_EQ(numbers[0].value, 1.25);
  EXPECT_DOUBLE_EQ(numbers[0].least, 0.125);
  EXPECT_DOUBLE_EQ(numbers[0].most, 2.5);
  EXPECT_DOUBLE_EQ(numbers[1].most, 5.0);
}

TEST(LiveNumbers, HaveTheirLimitsInOrderWhenTheyAreNegative)
{
  double value = -0.5;
  const std::vector<LiveNumber> numbers =
      aroundNow({ real("correlation", value, "", "[-1, 1)", "least correlation") }, { "correlation" }, { 0.5, 4.0 });
  EXPECT_DOUBLE_EQ(numbers[0].least, -2.0);
  EXPECT_DOUBLE_EQ(numbers[0].most, -0.25);
}

TEST(LiveNumbers, UpToNowAreNeverRaised)
{
  Servo25dParams params = started();
  const std::vector<LiveNumber> numbers = upToNow(parameters(params), { "gain" }, 0.001);
  EXPECT_DOUBLE_EQ(numbers[0].least, 0.001);
  EXPECT_DOUBLE_EQ(numbers[0].most, 1.25);
}

TEST(LiveNumbers, RefuseNamesThatAreNoNumbers)
{
  Servo25dParams params = started();
  EXPECT_THROW(aroundNow(parameters(params), { "gian" }, LIVE_GAIN), std::invalid_argument);
  EXPECT_THROW(setNumbers(parameters(params), { { "gian", "", 1.0, 0.0, 2.0 } }), std::invalid_argument);
}

TEST(LiveGroup, IsCheckedAsAtTheStartAndTakenOverExactly)
{
  Servo25dParams taken;
  const LiveGroup group =
      liveGroup<Servo25dParams>(started(), gains(), [&taken](const Servo25dParams& live) { taken = live; });
  std::vector<LiveNumber> numbers = group.numbers;
  EXPECT_EQ(group.fault(numbers), "");
  numbers[0].value = 1.0 / 3.0;
  numbers[1].value = 0.7;
  EXPECT_EQ(group.fault(numbers), "");
  group.apply(numbers);
  EXPECT_EQ(taken.gain, 1.0 / 3.0);
  EXPECT_EQ(taken.near_gain, 0.7);
  EXPECT_EQ(taken.dwell, started().dwell);
  numbers[1].value = 0.3;  // below the gain
  EXPECT_NE(group.fault(numbers).find("near_gain"), std::string::npos) << group.fault(numbers);
}

}  // namespace
}  // namespace view_servo
