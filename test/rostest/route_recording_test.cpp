// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A route is recorded while the base is driven. */
#include "routes_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
TEST_F(RoutesTest, RecordsViewsAlongTheWay)
{
  recordHall();
  const Route route = store_->load("hall");
  ASSERT_GE(route.stops.size(), 5U);
  EXPECT_NEAR(lengthOf(route), std::hypot(END.x - BEGIN.x, END.y - BEGIN.y), 0.1);
  for (std::size_t i = 1; i < route.stops.size(); ++i)
  {
    const double step = compose(inverse(route.stops[i - 1].base), route.stops[i].base).distance();
    EXPECT_LE(step, 0.75) << i;
    EXPECT_GT(route.stops[i].stamp, route.stops[i - 1].stamp);
  }
  EXPECT_TRUE(store_->views().load("hall_001").camera);
  EXPECT_NE(start("hall").find("there is one of that name"), std::string::npos);
}

TEST_F(RoutesTest, ReplacesARouteWhenItIsAskedTo)
{
  const std::string recorder = "replacing_recorder";  // whose ~overwrite is "again"
  ASSERT_TRUE(waitForService(recorder + "/stop"));
  putAt(BEGIN);
  std::vector<std::size_t> views;
  for (const double length : { 1.2, 0.3 })
  {
    std::string answer;
    EXPECT_TRUE(waitUntil([&] {
      answer = start("again", recorder);
      return answer.find("refused") == std::string::npos;
    })) << answer;
    drive(length, 0.0);
    answer = stop(recorder);
    ASSERT_EQ(answer.find("refused"), std::string::npos) << answer;
    const Route route = store_->load("again");
    EXPECT_NEAR(lengthOf(route), length, 0.1);
    views.push_back(route.stops.size());
  }
  ASSERT_LT(views[1], views[0]);
  EXPECT_EQ(store_->views().revisions().count(viewNameOf("again", views[0])), 0U) << "the old one's views are deleted";
  camera_ = false;
  EXPECT_NE(start("again", recorder).find("refused"), std::string::npos);
  camera_ = true;
  EXPECT_EQ(store_->load("again").stops.size(), views[1]) << "it is kept until there is something to replace it with";
  lost_ = true;
  EXPECT_NE(start("again", recorder).find("nowhere"), std::string::npos);
  lost_ = false;
  EXPECT_EQ(store_->load("again").stops.size(), views[1]) << "it is kept while tf does not know the camera";
  StoredView other = store_->views().load("again_001");
  other.name = "again_099";
  store_->views().save(other, false);
  EXPECT_NE(start("again", recorder).find("there is a view 'again_099' already"), std::string::npos);
  EXPECT_EQ(store_->load("again").stops.size(), views[1]) << "it is kept while a name is in use";
  store_->views().remove(other.name);
  store_->rename("again", "renamed");
  EXPECT_NE(start("again", recorder).find("there is a view 'again_00"), std::string::npos) << "another route's";
  EXPECT_NE(start("renamed", recorder).find("there is one of that name"), std::string::npos);
  EXPECT_EQ(store_->load("renamed").stops.size(), views[1]);
  store_->remove("renamed");
}

TEST_F(RoutesTest, RefusesToRecordWhatCannotBe)
{
  EXPECT_EQ(stop(), "refused: no route is recorded: call ~start first");
  EXPECT_NE(start("../hall").find("a route's name is"), std::string::npos);
  putAt(BEGIN);
  EXPECT_EQ(start("short").find("refused"), std::string::npos);
  EXPECT_NE(start("other").find("route 'short' is, call ~stop first"), std::string::npos);
  EXPECT_NE(stop().find("the base has not moved"), std::string::npos);
  EXPECT_FALSE(store_->has("short"));
  EXPECT_EQ(store_->views().revisions().count("short_001"), 0U) << "no half route";
}

TEST_F(RoutesTest, KeepsWhatItHasWhenTheCameraStops)
{
  putAt(BEGIN);
  camera_ = false;
  EXPECT_NE(start("dark").find("refused: route 'dark' is not recorded: "), std::string::npos);
  camera_ = true;
  for (const double way : { 0.2, 0.6 })
  {
    ASSERT_TRUE(waitUntil([this] { return start("dark").find("refused") == std::string::npos; }));
    drive(way, 0.0);
    const std::size_t views = store_->views().revisions().count("dark_002");
    EXPECT_EQ(views, way > 0.5 ? 1U : 0U);
    camera_ = false;
    const std::string answer = stop();
    camera_ = true;
    if (views == 0)
    {
      EXPECT_NE(answer.find("route 'dark' is not stored, and its views are removed: "), std::string::npos) << answer;
      EXPECT_FALSE(store_->has("dark"));
      EXPECT_EQ(store_->views().revisions().count("dark_001"), 0U) << "one view is no route";
    }
    else
    {
      EXPECT_EQ(answer.find("stored route 'dark', "), 0U) << answer;
      EXPECT_NE(answer.find("; it ends there, as "), std::string::npos) << answer;
      EXPECT_GE(store_->load("dark").stops.size(), 2U);
    }
  }
  store_->remove("dark");
}

TEST_F(RoutesTest, SaysWhenTheBaseGoesOnWithoutImages)
{
  putAt(BEGIN);
  ASSERT_EQ(start("gap").find("refused"), std::string::npos);
  camera_ = false;
  drive(1.2, 0.0);
  camera_ = true;
  const std::string answer = stop();
  EXPECT_NE(answer.find("without a usable image since view 'gap_001': drive slower"), std::string::npos) << answer;
  EXPECT_FALSE(store_->has("gap"));
}

}  // namespace
}  // namespace test
}  // namespace view_servo
