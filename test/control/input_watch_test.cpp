// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/input_watch.h"

#include "view_servo/parameters/seconds_since.h"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>

namespace view_servo
{
namespace
{
using Clock = InputWatch::Clock;

/** Whether a watch becomes stale; gives up long after it should have. */
bool becomesStale(const InputWatch& watch)
{
  constexpr double DEADLINE = 20.0;  // [s]
  const Clock::time_point start = Clock::now();
  while (!watch.stale() && secondsSince(start) < watch.timeout() + DEADLINE)
  {
  }
  return watch.stale();
}

}  // namespace

TEST(InputWatch, IsFreshAtFirst)
{
  const InputWatch patient(3600.0);
  EXPECT_FALSE(patient.stale());
  EXPECT_EQ(patient.timeout(), 3600.0);
  EXPECT_FALSE(InputWatch(std::numeric_limits<double>::infinity()).stale());
}

TEST(InputWatch, BecomesStaleAfterItsTimeout)
{
  EXPECT_TRUE(becomesStale(InputWatch(0.0)));
  const Clock::time_point before = Clock::now();
  const InputWatch watch(0.02);
  EXPECT_TRUE(becomesStale(watch));
  EXPECT_GT(secondsSince(before), 0.02);  // not before it is over
  EXPECT_GT(watch.age(), 0.02);
}

TEST(InputWatch, AgeIsTheTimeSinceItWasFed)
{
  const Clock::time_point before = Clock::now();
  InputWatch watch(0.02);
  const Clock::time_point after = Clock::now();
  ASSERT_TRUE(becomesStale(watch));
  EXPECT_GE(watch.age(), 0.02);
  const double shortest = secondsSince(after);
  const double age = watch.age();
  EXPECT_GE(age, shortest);
  EXPECT_LE(age, secondsSince(before));
  // Fed, it is no older than the moment before.
  const Clock::time_point fed = Clock::now();
  watch.restart();
  const double new_age = watch.age();
  EXPECT_LE(new_age, secondsSince(fed));
}

TEST(InputWatch, FreshInputMakesItGoodAgain)
{
  // A machine that is busy may take longer than the timeout between two lines: then once more.
  constexpr double TIMEOUT = 0.02;
  InputWatch watch(TIMEOUT);
  bool looked_in_time = false;
  for (int trial = 0; trial < 100 && !looked_in_time; ++trial)
  {
    ASSERT_TRUE(becomesStale(watch));
    const Clock::time_point fed = Clock::now();
    watch.restart();
    const bool stale = watch.stale();
    looked_in_time = secondsSince(fed) < TIMEOUT;
    EXPECT_FALSE(looked_in_time && stale);
  }
  EXPECT_TRUE(looked_in_time);
}

}  // namespace view_servo
