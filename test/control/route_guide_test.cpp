// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/route_guide.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** Three stops, half a metre apart, the last one turned; recorded in a frame that is elsewhere than odometry's. */
Route makeRoute()
{
  const PlanarPose frame{ 3.0, -2.0, 1.0 };
  Route route;
  route.name = "hall";
  route.stops = { { "a", compose(frame, { 0.0, 0.0, 0.0 }), 0.0 },
                  { "b", compose(frame, { 0.5, 0.0, 0.0 }), 0.0 },
                  { "c", compose(frame, { 1.0, 0.1, 0.2 }), 0.0 } };
  return route;
}

/** What homing knows when the points of a view are tracked. */
HomingReport trackedReport(const PlanarPose& base, const PlanarPose& goal, bool metric)
{
  const PlanarPose left = compose(inverse(base), goal);
  HomingReport report;
  report.state = HomingState::APPROACHING;
  report.tracked = true;
  report.distance = left.distance();
  report.heading = left.heading();
  report.yaw_error = left.yaw;
  if (metric)
  {
    report.goal_in_odom = goal;
  }
  return report;
}

std::string errorOf(const std::string& start, const std::string& goal, bool reverse)
{
  try
  {
    stopsBetween(makeRoute(), start, goal, reverse);
  }
  catch (const std::invalid_argument& error)
  {
    return error.what();
  }
  return "no error";
}

TEST(StopsBetween, AreThoseOnTheWay)
{
  const auto names = [](const std::string& start, const std::string& goal, bool reverse) {
    std::string text;
    for (const RouteStop& stop : stopsBetween(makeRoute(), start, goal, reverse))
    {
      text += stop.view;
    }
    return text;
  };
  EXPECT_EQ(names("", "", false), "abc");
  EXPECT_EQ(names("b", "", false), "bc");
  EXPECT_EQ(names("", "b", false), "ab");
  EXPECT_EQ(names("b", "b", false), "b");
  EXPECT_EQ(names("", "", true), "cba");
  EXPECT_EQ(names("b", "", true), "ba");
  EXPECT_EQ(errorOf("x", "", false), "view 'x' is not on route 'hall'");
  EXPECT_EQ(errorOf("", "x", true), "view 'x' is not on route 'hall'");
  EXPECT_NE(errorOf("c", "a", false).find("comes before view 'c' on route 'hall'; reverse: true"), std::string::npos);
  EXPECT_NE(errorOf("a", "c", true).find("in reverse"), std::string::npos);
}

TEST(RouteGuide, GoesOnNearAViewThatIsNotTheLast)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose at_a{ 10.0, 5.0, 0.5 };
  EXPECT_EQ(guide.view(), "a");
  EXPECT_EQ(guide.next(), "b");
  EXPECT_FALSE(guide.blindCourse()) << "nothing is known yet";
  const PlanarPose far = compose(at_a, { -0.6, 0.0, 0.0 });
  guide.addReport(trackedReport(far, at_a, true), far);
  EXPECT_FALSE(guide.isTimeToGoOn());
  const PlanarPose near = compose(at_a, { -0.29, 0.0, 0.0 });
  guide.addReport(trackedReport(near, at_a, false), near);
  EXPECT_FALSE(guide.isTimeToGoOn()) << "how far it is in metres is not known";
  const PlanarPose turned = compose(at_a, { -0.1, 0.0, 0.2 });
  guide.addReport(trackedReport(turned, at_a, true), turned);
  EXPECT_FALSE(guide.isTimeToGoOn());
  guide.addReport(trackedReport(near, at_a, true), near);
  ASSERT_TRUE(guide.isTimeToGoOn());
  guide.goOn();
  EXPECT_EQ(guide.view(), "b");
  EXPECT_FALSE(guide.isTimeToGoOn());

  const PlanarPose at_b = compose(at_a, { 0.5, 0.0, 0.0 });
  guide.addReport(trackedReport(at_b, at_b, true), at_b);
  ASSERT_TRUE(guide.isTimeToGoOn());
  guide.goOn();
  const PlanarPose at_c = compose(at_a, { 1.0, 0.1, 0.2 });
  guide.addReport(trackedReport(at_c, at_c, true), at_c);
  EXPECT_FALSE(guide.isTimeToGoOn()) << "the last view is homed to";
  EXPECT_TRUE(guide.last());
  EXPECT_THROW(guide.goOn(), std::logic_error);
}

TEST(RouteGuide, GoesOnWhereThePointsAreInPlace)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose base{ 1.0, 1.0, 0.0 };
  HomingReport report = trackedReport(base, compose(base, { 2.0, 0.0, 0.0 }), false);  // by a wrong scale
  report.state = HomingState::DOCKING;
  report.displacement = 20.0;
  guide.addReport(report, base);
  EXPECT_FALSE(guide.isTimeToGoOn());
  report.displacement = 4.0;
  guide.addReport(report, base);
  ASSERT_TRUE(guide.isTimeToGoOn());
  guide.goOn();
  const std::optional<Course> course = guide.blindCourse();
  ASSERT_TRUE(course);
  EXPECT_NEAR(course->view.x, 1.0 + 0.3 + 0.5, 1e-12);
}

/** A picture of the view, or a camera that sends one image again and again, is no place to go on to. */
TEST(RouteGuide, DoesNotLeadToWhatDoesNotMoveAsTheBaseDoes)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose base{ 1.0, 1.0, 0.0 };
  guide.addOdometry(base);
  guide.addReport(trackedReport(base, compose(base, { 2.0, 0.0, 0.0 }), true), base);
  HomingReport lost;
  lost.state = HomingState::LOST;
  guide.addReport(lost, base);
  EXPECT_TRUE(guide.blindCourse()) << "the view is only hidden";
  lost.contradicted = true;
  guide.addReport(lost, base);
  EXPECT_FALSE(guide.blindCourse());
}

TEST(RouteGuide, DoesNotGoOnFromAViewThatIsNotTrusted)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose base{ 1.0, 1.0, 0.0 };
  HomingReport report = trackedReport(base, base, true);
  report.displacement = 0.0;
  report.trusted = false;
  guide.addReport(report, base);
  EXPECT_FALSE(guide.isTimeToGoOn());
  report.trusted = true;
  guide.addReport(report, base);
  EXPECT_TRUE(guide.isTimeToGoOn());
}

TEST(RouteGuide, LeadsByOdometryWithinBounds)
{
  RouteGuideParams params;
  params.blind_distance = 0.2;
  params.blind_turn = 0.3;
  for (const PlanarPose& step : { PlanarPose{ 0.15, 0.0, 0.0 }, PlanarPose{ 0.0, 0.0, -0.2 } })
  {
    RouteGuide guide(params, makeRoute().stops, 0.1);
    const PlanarPose at_a{ 10.0, 5.0, 0.5 };
    guide.addOdometry(at_a);
    guide.addReport(trackedReport(at_a, at_a, true), at_a);
    EXPECT_FALSE(guide.blindCourse()) << "homing knows the way";
    guide.goOn();
    const std::optional<Course> course = guide.blindCourse();
    ASSERT_TRUE(course);
    const PlanarPose expected = compose(at_a, { 0.5, 0.0, 0.0 });
    EXPECT_NEAR(course->view.x, expected.x, 1e-12);
    EXPECT_NEAR(course->view.y, expected.y, 1e-12);
    EXPECT_NEAR(course->view.yaw, expected.yaw, 1e-12);
    EXPECT_EQ(course->max_speed, 0.1);
    const PlanarPose once = compose(at_a, step);
    guide.addOdometry(once);
    EXPECT_TRUE(guide.blindCourse());
    guide.addReport(HomingReport(), once);  // not found yet
    EXPECT_TRUE(guide.blindCourse());
    guide.addOdometry(compose(once, step));
    EXPECT_FALSE(guide.blindCourse()) << "far enough";
  }
}

TEST(RouteGuide, GoesToAnyViewOfTheWay)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose at_a{ 10.0, 5.0, 0.5 };
  guide.addReport(trackedReport(at_a, at_a, true), at_a);
  guide.jumpTo("c");
  EXPECT_EQ(guide.view(), "c");
  EXPECT_TRUE(guide.last());
  EXPECT_FALSE(guide.isTimeToGoOn());
  EXPECT_FALSE(guide.blindCourse()) << "where it is is not known";
  EXPECT_THROW(guide.jumpTo("x"), std::logic_error);
}

TEST(RouteGuide, GoesBackOnlyOnceForAViewThatIsNotFound)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose at_a{ 10.0, 5.0, 0.5 };
  guide.goOn();  // to b, which has changed since
  ASSERT_EQ(guide.view(), "b");
  EXPECT_FALSE(guide.mayJumpTo("b"));
  EXPECT_TRUE(guide.mayJumpTo("c"));
  ASSERT_TRUE(guide.mayJumpTo("a"));
  guide.jumpTo("a");
  guide.addReport(trackedReport(at_a, at_a, true), at_a);
  guide.goOn();
  EXPECT_FALSE(guide.mayJumpTo("a")) << "it would go to and fro";
  EXPECT_TRUE(guide.mayJumpTo("c")) << "farther on";
  guide.addReport(trackedReport(at_a, at_a, true), at_a);  // b is found after all
  EXPECT_TRUE(guide.mayJumpTo("a"));
}

TEST(RouteGuide, DoesNotTakeTheEndOfALoopForItsBeginning)
{
  std::vector<RouteStop> loop;
  for (int i = 0; i <= 8; ++i)
  {
    const double angle = i * M_PI / 4.0;  // a circle of 1 m, along which the base looks
    loop.push_back(
        { std::string(1, static_cast<char>('a' + i)), { std::sin(angle), 1.0 - std::cos(angle), angle }, 0 });
  }
  RouteGuide guide(RouteGuideParams(), loop, 0.1);
  EXPECT_TRUE(comesByAgain(loop, 0, 8));
  EXPECT_TRUE(comesByAgain(loop, 8, 0));
  EXPECT_FALSE(comesByAgain(loop, 0, 4)) << "it looks the other way there";
  EXPECT_FALSE(comesByAgain(loop, 0, 1));
  std::vector<RouteStop> dense;
  for (int i = 0; i < 6; ++i)
  {
    dense.push_back({ std::string(1, static_cast<char>('a' + i)), { 0.08 * i, 0.0, 0.0 }, 0.0 });
  }
  EXPECT_FALSE(comesByAgain(dense, 0, 5)) << "near, but the way has not been elsewhere";
  EXPECT_FALSE(guide.mayJumpTo("i")) << "the loop has not been driven";
  EXPECT_TRUE(guide.mayJumpTo("h"));
  guide.jumpTo("h");
  guide.goOn();
  EXPECT_FALSE(guide.mayJumpTo("a")) << "it would be driven once more";
}

TEST(RouteGuide, SaysHowTheBaseIsPlacedOnTheLine)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  const PlanarPose at_a{ 10.0, 5.0, 0.5 };
  guide.addReport(trackedReport(at_a, at_a, true), at_a);
  EXPECT_TRUE(std::isnan(guide.deviation(at_a).sideways)) << "no line leads to the first view";
  guide.goOn();
  const RouteGuide::Deviation deviation = guide.deviation(compose(at_a, { 0.2, 0.07, -0.03 }));
  EXPECT_NEAR(deviation.sideways, 0.07, 1e-12);
  EXPECT_NEAR(deviation.yaw, -0.03, 1e-12);
  guide.addReport(trackedReport(at_a, compose(at_a, { 0.5, 0.0, 0.0 }), true), at_a);
  guide.goOn();
  const PlanarPose half = compose(at_a, { 0.75, 0.05, 0.1 });
  EXPECT_NEAR(guide.deviation(half).sideways, 0.0, 1e-12);
  EXPECT_NEAR(guide.deviation(half).yaw, 0.0, 1e-12);
}

TEST(RouteGuide, PlacesTheStopsBesideTheViewThatIsFound)
{
  RouteGuide guide(RouteGuideParams(), makeRoute().stops, 0.1);
  EXPECT_TRUE(guide.places(10).stops.empty()) << "nothing is known yet";
  const PlanarPose at_a{ 10.0, 5.0, 0.5 };
  guide.addReport(trackedReport(at_a, at_a, true), at_a);
  guide.goOn();
  const RoutePlaces places = guide.places(10);
  ASSERT_EQ(places.stops.size(), 3U);
  EXPECT_EQ(places.index, 1U);
  const PlanarPose at_c = compose(at_a, { 1.0, 0.1, 0.2 });
  EXPECT_NEAR(compose(inverse(at_a), places.stops[0]).distance(), 0.0, 1e-12);
  EXPECT_NEAR(compose(inverse(at_c), places.stops[2]).distance(), 0.0, 1e-12);
  EXPECT_NEAR(wrapAngle(places.stops[2].yaw - at_c.yaw), 0.0, 1e-12);
  EXPECT_EQ(guide.places(0).stops.size(), 1U);
  EXPECT_EQ(guide.places(0).index, 0U);
  guide.jumpTo("c");
  EXPECT_TRUE(guide.places(10).stops.empty()) << "where that is is not known";
}

}  // namespace
}  // namespace view_servo
