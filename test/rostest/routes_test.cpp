// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A route is recorded while the base is driven 2 m through a room, and followed. */
#include "commands.h"
#include "node_test.h"

#include "view_servo/FollowRouteAction.h"
#include "view_servo/PointMatches.h"
#include "view_servo/RecognizedViews.h"
#include "view_servo/SetPose.h"
#include "view_servo/StartRoute.h"
#include "view_servo/WantedView.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/route_store.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <set>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
using GoalState = actionlib::SimpleClientGoalState;
using Clock = std::chrono::steady_clock;

constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;  // [s]
const PlanarPose BEGIN{ -2.0, 0.15, 0.0 };       // of the base in the world
const PlanarPose END{ 0.1, -0.1, 0.0 };

class RoutesTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    image_subscriber_ = nh_.subscribe<sensor_msgs::Image>(
        "camera/image_raw", 5, boost::function<void(const sensor_msgs::Image::ConstPtr&)>([this](const auto& message) {
          if (camera_)
          {
            images_.publish(message);
          }
        }));
    info_subscriber_ = nh_.subscribe<sensor_msgs::CameraInfo>(
        "camera/camera_info", 5,
        boost::function<void(const sensor_msgs::CameraInfo::ConstPtr&)>([this](const auto& message) {
          if (camera_)
          {
            infos_.publish(message);
          }
        }));
    matches_subscriber_ =
        nh_.subscribe<PointMatches>("point_matcher/point_matches", 5,
                                    boost::function<void(const PointMatches::ConstPtr&)>([this](const auto& message) {
                                      if (message->view != unmatched_)
                                      {
                                        matches_.publish(message);
                                      }
                                    }));
    ASSERT_TRUE(waitForService("route_recorder/stop") && waitForService("route_follower/enable"));
    ASSERT_TRUE(
        waitUntil([this] { return client_.isServerConnected() && truth_.last() && drive_.getNumSubscribers() > 0; }));
    ASSERT_TRUE(waitUntil([this] { return images_.getNumSubscribers() >= 3 && infos_.getNumSubscribers() >= 3; }));
    std_srvs::SetBool enable;
    enable.request.data = 1;
    ASSERT_TRUE(callService("route_follower/enable", enable));
    store_ = std::make_unique<RouteStore>(viewsDir("route_recorder"));
  }

  void TearDown() override
  {
    camera_ = true;
    client_.cancelAllGoals();
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  static void TearDownTestSuite()
  {
    removeViews("route_recorder");
  }

  /** Of a camera, with x along its axis; the base's camera is above its middle. */
  static PlanarPose onFloor(const geometry_msgs::Pose& camera)
  {
    const Eigen::Quaterniond turn(camera.orientation.w, camera.orientation.x, camera.orientation.y,
                                  camera.orientation.z);
    const Eigen::Vector3d axis = turn * Eigen::Vector3d::UnitZ();
    return { camera.position.x, camera.position.y, std::atan2(axis.y(), axis.x()) };
  }

  /** The true pose, in the world. */
  PlanarPose truth() const
  {
    return onFloor(truth_.last()->pose);
  }

  PlanarPose truthAt(const ros::Time& stamp) const
  {
    PlanarPose pose;
    for (const geometry_msgs::PoseStamped& message : truth_.messages())
    {
      pose = message.header.stamp <= stamp ? onFloor(message.pose) : pose;
    }
    return pose;
  }

  /** Puts the camera where it is when the base is there, and waits until an image shows it. */
  void putAt(const PlanarPose& base)
  {
    SetPose move;
    move.request.pose.position.x = base.x;
    move.request.pose.position.y = base.y;
    move.request.pose.orientation.z = std::sin(0.5 * base.yaw);
    move.request.pose.orientation.w = std::cos(0.5 * base.yaw);
    ASSERT_TRUE(callService("nomad_sim/set_pose", move) && move.response.success) << move.response.message;
    const ros::Time now = ros::Time::now();
    ASSERT_TRUE(waitUntil([&] { return truth_.last()->header.stamp > now + ros::Duration(0.2); }));
  }

  std::string start(const std::string& route)
  {
    StartRoute service;
    service.request.name = route;
    EXPECT_TRUE(callService("route_recorder/start", service));
    return (service.response.success ? "" : "refused: ") + service.response.message;
  }

  std::string stop()
  {
    std_srvs::Trigger service;
    EXPECT_TRUE(callService("route_recorder/stop", service));
    return (service.response.success ? "" : "refused: ") + service.response.message;
  }

  /** Drives the base straight by as much. */
  void drive(double x, double y)
  {
    constexpr double SPEED = 0.2;  // [m/s]
    const PlanarPose from = truth();
    const double length = std::hypot(x, y);
    EXPECT_TRUE(waitUntil([&] { return compose(inverse(from), truth()).distance() >= length; },
                          [&] {
                            geometry_msgs::Twist twist;
                            twist.linear.x = SPEED * x / length;
                            twist.linear.y = SPEED * y / length;
                            drive_.publish(twist);
                          }));
    drive_.publish(geometry_msgs::Twist());
    const ros::Time now = ros::Time::now();
    EXPECT_TRUE(waitUntil([&] { return truth_.last()->header.stamp > now + ros::Duration(0.5); }));
  }

  /** Records the route `hall`, once. Its last view is at END. */
  void recordHall()
  {
    if (store_->has("hall"))
    {
      return;
    }
    putAt(BEGIN);
    hall_begin = truth();
    ASSERT_EQ(start("hall"), "route 'hall' is recorded from view 'hall_001' on, until ~stop");
    drive(END.x - BEGIN.x, END.y - BEGIN.y);
    const std::string answer = stop();
    ASSERT_NE(answer.find("stored route 'hall', "), std::string::npos) << answer;
    hall_end = truth();
  }

  void send(const std::string& route, const std::string& from = "", const std::string& to = "", bool reverse = false)
  {
    FollowRouteGoal goal;
    goal.route = route;
    goal.start = from;
    goal.goal = to;
    goal.reverse = reverse ? 1 : 0;
    goal.timeout = 240.0 * SLOWDOWN;
    client_.sendGoal(goal, Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                     [this](const FollowRouteFeedbackConstPtr& feedback) {
                       const std::lock_guard<std::mutex> lock(mutex_);
                       feedback_.push_back(*feedback);
                     });
  }

  /** The result of the goal, which may take minutes. */
  FollowRouteResult result()
  {
    for (int i = 0; i < 15 && !waitUntil([this] { return client_.getState().isDone(); }); ++i)
    {
    }
    const auto found = client_.getResult();
    EXPECT_TRUE(found) << reason();
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
    return found ? *found : FollowRouteResult();
  }

  std::string reason() const
  {
    return status_.last() ? status_.last()->reason : "no status";
  }

  void expectRefusal(const std::string& words)
  {
    const Clock::time_point moment = Clock::now();
    const FollowRouteResult final = result();
    EXPECT_FALSE(final.success);
    EXPECT_NE(final.message.find(words), std::string::npos) << final.message;
    EXPECT_LT(commands_.lastMotionAfter(moment), 0.0) << "nothing moves";
  }

  void followUntilItMoves()
  {
    recordHall();
    putAt({ -1.9, 0.1, 0.03 });
    send("hall");
    ASSERT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  }

  static PlanarPose hall_begin;  // where the base was when its first view was stored
  static PlanarPose hall_end;    // and its last

  using Client = actionlib::SimpleActionClient<FollowRouteAction>;
  ros::NodeHandle nh_;
  std::unique_ptr<RouteStore> store_;
  std::atomic<bool> camera_{ true };  // is handed on
  ros::Publisher images_ = nh_.advertise<sensor_msgs::Image>("seen/image_raw", 5);
  ros::Publisher infos_ = nh_.advertise<sensor_msgs::CameraInfo>("seen/camera_info", 5);
  ros::Publisher drive_ = nh_.advertise<geometry_msgs::Twist>("cmd_vel", 5);
  Recorder<geometry_msgs::PoseStamped> truth_{ "ground_truth" };
  Recorder<ServoStatus> status_{ "status" };
  Recorder<WantedView> wanted_{ "route_follower/wanted_view" };
  CommandsOf<geometry_msgs::Twist> commands_{ "cmd_vel" };
  Client client_{ "follow", false };
  std::mutex mutex_;
  std::deque<FollowRouteFeedback> feedback_;
  std::string unmatched_;  // the matches of this view are not handed on
  ros::Publisher matches_ = nh_.advertise<PointMatches>("seen/point_matches", 5);
  ros::Subscriber matches_subscriber_;
  ros::Subscriber image_subscriber_;
  ros::Subscriber info_subscriber_;
};

PlanarPose RoutesTest::hall_begin;
PlanarPose RoutesTest::hall_end;

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

TEST_F(RoutesTest, LeavesNoHalfRouteWhenTheCameraStops)
{
  putAt(BEGIN);
  camera_ = false;
  EXPECT_NE(start("dark").find("refused: route 'dark' is not recorded: "), std::string::npos);
  camera_ = true;
  ASSERT_TRUE(waitUntil([this] { return start("dark").find("refused") == std::string::npos; }));
  drive(0.6, 0.0);
  EXPECT_EQ(store_->views().revisions().count("dark_002"), 1U);
  camera_ = false;
  const std::string answer = stop();
  EXPECT_NE(answer.find("route 'dark' is not stored, and its views are removed: "), std::string::npos) << answer;
  EXPECT_FALSE(store_->has("dark"));
  EXPECT_EQ(store_->views().revisions().count("dark_001") + store_->views().revisions().count("dark_002"), 0U);
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

TEST_F(RoutesTest, FollowsARouteToItsExactEnd)
{
  recordHall();
  putAt({ -2.05, 0.05, 0.04 });
  const ros::Time begin = ros::Time::now();
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
  send("hall", from, route.stops[0].view, true);
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
  expectRefusal("the goal names no route");
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
