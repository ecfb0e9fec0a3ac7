// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "commands.h"
#include "node_test.h"

#include "view_servo/FollowRouteAction.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetPose.h"
#include "view_servo/StartRoute.h"
#include "view_servo/WantedView.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/route_store.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <deque>
#include <memory>
#include <mutex>
#include <string>

namespace view_servo
{
namespace test
{
/** @file What the tests of routes.test share. */

using Clock = std::chrono::steady_clock;

inline const PlanarPose BEGIN{ -2.0, 0.15, 0.0 };  // of the base in the world, where the route `hall` begins
inline const PlanarPose END{ 0.1, -0.1, 0.0 };     // and where it ends

/** A base that is driven 2 m through a room while its way is recorded as a route, which it follows then. */
class RoutesTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    image_subscriber_ = nh_.subscribe<sensor_msgs::Image>(
        "camera/image_raw", 5, boost::function<void(const sensor_msgs::Image::ConstPtr&)>([this](const auto& message) {
          if (camera_)
          {
            sensor_msgs::Image image = *message;
            image.header.frame_id = lost_ ? "nowhere" : image.header.frame_id;
            images_.publish(image);
          }
        }));
    info_subscriber_ = nh_.subscribe<sensor_msgs::CameraInfo>(
        "camera/camera_info", 5,
        boost::function<void(const sensor_msgs::CameraInfo::ConstPtr&)>([this](const auto& message) {
          if (camera_)
          {
            sensor_msgs::CameraInfo info = *message;
            info.header.frame_id = lost_ ? "nowhere" : info.header.frame_id;
            infos_.publish(info);
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
    lost_ = false;
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

  std::string start(const std::string& route, const std::string& recorder = "route_recorder")
  {
    StartRoute service;
    service.request.name = route;
    EXPECT_TRUE(callService(recorder + "/start", service));
    return (service.response.success ? "" : "refused: ") + service.response.message;
  }

  std::string stop(const std::string& recorder = "route_recorder")
  {
    std_srvs::Trigger service;
    EXPECT_TRUE(callService(recorder + "/stop", service));
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

  inline static PlanarPose hall_begin;  // where the base was when its first view was stored
  inline static PlanarPose hall_end;    // and its last

  using Client = actionlib::SimpleActionClient<FollowRouteAction>;
  ros::NodeHandle nh_;
  std::unique_ptr<RouteStore> store_;
  std::atomic<bool> camera_{ true };  // is handed on
  std::atomic<bool> lost_{ false };   // tf does not know where the camera is
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

}  // namespace test
}  // namespace view_servo
