// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A route is followed. */
#include "routes_test.h"

#include "view_servo/RecognizedViews.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
using GoalState = actionlib::SimpleClientGoalState;

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

/** The points of the marker of that namespace in the last message that adds it; empty without one. */
std::vector<geometry_msgs::Point> lastPoints(const std::deque<MarkerArray>& messages, const std::string& part)
{
  std::vector<geometry_msgs::Point> points;
  for (const MarkerArray& message : messages)
  {
    for (const Marker& marker : message.markers)
    {
      points = marker.ns == part && marker.action == Marker::ADD ? marker.points : points;
    }
  }
  return points;
}

constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;  // [s]

TEST_F(RoutesTest, FollowsARouteToItsExactEnd)
{
  recordHall();
  putAt({ -2.05, 0.05, 0.04 });
  const ros::Time begin = ros::Time::now();
  const Recorder<MarkerArray> markers("route_follower/markers");
  send("hall");
  const FollowRouteResult final = result();
  ASSERT_TRUE(final.success) << final.message;
  const PlanarPose off = compose(inverse(hall_end), truth());
  EXPECT_LT(off.distance(), 0.01);
  EXPECT_LT(std::abs(off.yaw), 1.0 * DEGREE);
  EXPECT_GT(final.travelled, 2.0);
  EXPECT_LT(final.travelled, 3.0);
  const Route route = store_->load("hall");
  std::set<std::string> views;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const FollowRouteFeedback& feedback : feedback_)
    {
      views.insert(feedback.view);
    }
  }
  EXPECT_EQ(views.size(), route.stops.size());

  // The true way: beside the line, and where one view after another was left.
  const PlanarPose line{ hall_begin.x, hall_begin.y, std::atan2(hall_end.y - hall_begin.y, hall_end.x - hall_begin.x) };
  const auto recorded = [&](std::size_t i) {
    return compose(hall_begin, compose(inverse(route.stops[0].base), route.stops[i].base));
  };
  double farthest = 0.0;
  for (const geometry_msgs::PoseStamped& message : truth_.messages())
  {
    if (message.header.stamp > begin)
    {
      farthest = std::max(farthest, std::abs(compose(inverse(line), onFloor(message.pose)).y));
    }
  }
  double earliest = 0.0;
  for (const WantedView& wanted : wanted_.messages())
  {
    for (std::size_t i = 1; i < route.stops.size() && wanted.header.stamp > begin; ++i)
    {
      if (wanted.view == route.stops[i].view)
      {
        earliest = std::max(earliest, compose(inverse(recorded(i - 1)), truthAt(wanted.header.stamp)).distance());
      }
    }
  }
  EXPECT_LT(farthest, 0.15);
  EXPECT_LT(earliest, 0.4) << "a view is left before the base is near it";
  EXPECT_TRUE(waitUntil([this] { return wanted_.last()->view.empty(); }));

  // The route's stops as it saw them in the end, with the base at the last one.
  const std::vector<geometry_msgs::Point> stops = lastPoints(markers.messages(), "stops");
  const std::vector<geometry_msgs::Point> driven = lastPoints(markers.messages(), "way_driven");
  ASSERT_EQ(stops.size(), route.stops.size());
  ASSERT_FALSE(driven.empty());
  EXPECT_LT(std::hypot(stops.back().x - driven.back().x, stops.back().y - driven.back().y), 0.02);
  EXPECT_NEAR(std::hypot(stops.back().x - stops.front().x, stops.back().y - stops.front().y),
              compose(inverse(route.stops.front().base), route.stops.back().base).distance(), 1e-6);
  std::printf(
      "[ MEASURED ] %.1f mm and %.2f degrees off, at most %.0f mm beside the line and %.0f mm before a view that is "
      "left, %.2f m in %.0f s\n",
      1e3 * off.distance(), off.yaw / DEGREE, 1e3 * farthest, 1e3 * earliest, final.travelled, final.duration);
}

TEST_F(RoutesTest, FollowsAPartOfARouteInReverse)
{
  recordHall();
  const Route route = store_->load("hall");
  const std::string from = route.stops[2].view;
  const PlanarPose on_route = compose(inverse(route.stops.back().base), route.stops[2].base);
  putAt(compose(hall_end, on_route));
  send("", from, route.stops[0].view, true);  // the route is the one of the view
  const FollowRouteResult final = result();
  ASSERT_TRUE(final.success) << final.message;
  const PlanarPose begin = compose(hall_end, compose(inverse(route.stops.back().base), route.stops[0].base));
  const PlanarPose off = compose(inverse(begin), truth());
  EXPECT_LT(off.distance(), 0.02);
  EXPECT_LT(std::abs(off.yaw), 1.0 * DEGREE);
}

TEST_F(RoutesTest, StopsAtOnceWhenItIsCancelled)
{
  followUntilItMoves();
  const Clock::time_point moment = Clock::now();
  client_.cancelGoal();
  EXPECT_NE(result().message.find("cancelled"), std::string::npos);
  EXPECT_EQ(client_.getState().state_, GoalState::PREEMPTED);
  EXPECT_LT(commands_.lastMotionAfter(moment), STOPS_WITHIN);
}

TEST_F(RoutesTest, StopsWhenTheCameraStops)
{
  followUntilItMoves();
  const Clock::time_point moment = Clock::now();
  camera_ = false;
  EXPECT_TRUE(waitUntil([this] { return reason().find("no image") != std::string::npos; })) << reason();
  EXPECT_LT(commands_.lastMotionAfter(moment), STOPS_WITHIN);
  camera_ = true;
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  camera_ = false;
  EXPECT_FALSE(result().success) << "it gives up";
}

TEST_F(RoutesTest, BeginsAtTheViewThatARecognizerSees)
{
  recordHall();
  const std::string seen = store_->load("hall").stops[3].view;
  ros::Publisher recognizer = nh_.advertise<RecognizedViews>("recognized", 1);
  ASSERT_TRUE(waitUntil([&] { return !wanted_.last() || wanted_.last()->view.empty(); }));
  send("hall");
  const ros::Time begin = ros::Time::now();
  EXPECT_TRUE(
      waitUntil([&] { return wanted_.last() && wanted_.last()->header.stamp > begin && !wanted_.last()->view.empty(); },
                [&] {
                  RecognizedViews message;
                  message.header.stamp = ros::Time::now();
                  message.views.resize(3);
                  message.views[0].view = "elsewhere";
                  message.views[0].verified = 1;
                  message.views[1].view = "hall_002";
                  message.views[2].view = seen;
                  message.views[2].verified = 1;
                  recognizer.publish(message);
                }));
  EXPECT_EQ(wanted_.last()->view, seen) << "neither one that is not on the route, nor one that is not verified";
  client_.cancelGoal();
  EXPECT_FALSE(result().success);
}

/** The matcher says nothing of one view. */
class UnmatchedTest : public RoutesTest
{
protected:
  UnmatchedTest()
  {
    unmatched_ = "hall_002";
  }
};

TEST_F(UnmatchedTest, GoesOnByOdometryNoFartherThanItMay)
{
  constexpr double BLIND_DISTANCE = 0.5;  // the default [m]
  constexpr double BRAKING = 0.05;        // [m]
  recordHall();
  putAt({ -2.05, 0.1, 0.0 });
  send("hall");
  ASSERT_TRUE(waitUntil([&] { return wanted_.last() && wanted_.last()->view == unmatched_; })) << reason();
  const PlanarPose begin = truth();
  EXPECT_TRUE(waitUntil([&] { return reason().find("goes on by odometry") != std::string::npos; })) << reason();
  const FollowRouteResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("view 'hall_002', 2 of "), std::string::npos) << final.message;
  const double gone = compose(inverse(begin), truth()).distance();
  EXPECT_GT(gone, 0.1);
  EXPECT_LT(gone, BLIND_DISTANCE + BRAKING);
}

TEST_F(UnmatchedTest, GoesOnAtTheViewThatARecognizerSees)
{
  recordHall();
  ros::Publisher recognizer = nh_.advertise<RecognizedViews>("recognized", 1);
  putAt({ -2.05, 0.1, 0.0 });
  send("hall", "hall_001");
  ASSERT_TRUE(waitUntil([&] { return wanted_.last() && wanted_.last()->view == unmatched_; })) << reason();
  EXPECT_TRUE(waitUntil([&] { return wanted_.last()->view == "hall_004"; },
                        [&] {
                          RecognizedViews message;
                          message.header.stamp = ros::Time::now();
                          message.views.resize(1);
                          message.views[0].view = "hall_004";
                          message.views[0].verified = 1;
                          recognizer.publish(message);
                        }))
      << reason();
  const FollowRouteResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_LT(compose(inverse(hall_end), truth()).distance(), 0.01);
}

TEST_F(RoutesTest, RefusesBeforeAnythingMoves)
{
  recordHall();
  send("");
  expectRefusal("the goal names neither a route nor a view on one");
  send("", "", "desk");
  expectRefusal("view 'desk' is on no route");
  send("unknown");
  expectRefusal("cannot load route 'unknown': there is none of that name");
  send("hall", "desk");
  expectRefusal("view 'desk' is not on route 'hall'");
  send("hall", "hall_003", "hall_001");
  expectRefusal("comes before");
  const std::string yaml = store_->views().directory() / "hall_002.yaml";
  const std::string aside = yaml + ".aside";
  std::filesystem::rename(yaml, aside);
  send("hall");
  expectRefusal("its view 'hall_002' is not there");
  std::filesystem::rename(aside, yaml);
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "routes_test");
}
