// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/travelled_way.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace view_servo
{
namespace
{
TEST(TravelledWay, KeepsPlacesThatAreApartAndTheNewestOne)
{
  TravelledWay way(0.1);
  EXPECT_TRUE(way.places().empty());
  for (const double x : { 0.0, 0.04, 0.08, 0.12, 0.16 })
  {
    way.add({ x, 0.0, 0.0 });
  }
  ASSERT_EQ(way.places().size(), 3U);
  EXPECT_EQ(way.places()[0].x(), 0.0);
  EXPECT_EQ(way.places()[1].x(), 0.12);
  EXPECT_EQ(way.places()[2].x(), 0.16);
}

TEST(TravelledWay, LongWaysAreThinnedFromTheirBeginningToTheirEnd)
{
  TravelledWay way(0.1, 10);
  for (int i = 0; i <= 1000; ++i)
  {
    way.add({ 0.1 * i, 0.0, 0.0 });
  }
  const std::vector<Eigen::Vector3d> places = way.places();
  EXPECT_LE(places.size(), 11U);
  EXPECT_GE(places.size(), 5U);
  EXPECT_EQ(places.front().x(), 0.0);
  EXPECT_EQ(places.back().x(), 100.0);
  for (std::size_t i = 1; i < places.size(); ++i)
  {
    EXPECT_GT(places[i].x(), places[i - 1].x());
  }
}

TEST(TravelledWay, LeavesOutWhatIsNotFinite)
{
  TravelledWay way(0.1);
  way.add({ 0.0, std::numeric_limits<double>::quiet_NaN(), 0.0 });
  EXPECT_TRUE(way.places().empty());
  way.add({ 1.0, 0.0, 0.0 });
  way.add({ std::numeric_limits<double>::infinity(), 0.0, 0.0 });
  ASSERT_EQ(way.places().size(), 1U);
  EXPECT_EQ(way.places()[0].x(), 1.0);
}

TEST(TravelledWay, BeginsAnewAfterItWasCleared)
{
  TravelledWay way(0.1, 2);
  for (int i = 0; i < 100; ++i)
  {
    way.add({ 0.1 * i, 0.0, 0.0 });
  }
  way.clear();
  EXPECT_TRUE(way.places().empty());
  way.add({ 0.0, 0.0, 0.0 });
  way.add({ 0.11, 0.0, 0.0 });
  EXPECT_EQ(way.places().size(), 2U);
}

TEST(TravelledWay, RefusesWhatCannotBe)
{
  EXPECT_THROW(TravelledWay(0.0), std::logic_error);
  EXPECT_THROW(TravelledWay(0.1, 1), std::logic_error);
}

}  // namespace
}  // namespace view_servo
