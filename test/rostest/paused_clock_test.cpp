// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "driver_test.h"

#include "view_servo/HomeToViewAction.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/parameters/seconds_since.h"

#include <nav_msgs/Odometry.h>
#include <rosgraph_msgs/Clock.h>

namespace view_servo
{
namespace test
{
namespace
{
/** A clock that has come to 100 s and stands there, with a camera that tf does not know. */
class PausedClockTest : public ::testing::Test
{
protected:
  PausedClockTest() : camera_("camera")
  {
    clock_publisher_ = nh_.advertise<rosgraph_msgs::Clock>("/clock", 1, true);
    odometry_publisher_ = nh_.advertise<nav_msgs::Odometry>("odom", 5);
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(100.0);
    clock_publisher_.publish(clock);
  }

  /** What a camera and a base say at that time, again and again. */
  void publish()
  {
    const ros::Time now(100.0);
    camera_.publish(picture_, now);
    nav_msgs::Odometry odometry;
    odometry.header.stamp = now;
    odometry.pose.pose.orientation.w = 1.0;
    odometry_publisher_.publish(odometry);
  }

  template <typename Action>
  struct Driver
  {
    Driver(const std::string& node, const std::string& action)
      : client(action, false), status("status"), enable_service(node + "/enable")
    {
    }

    void send(double timeout)
    {
      enableAndSend(client, enable_service, "goal", timeout);
    }

    actionlib::SimpleActionClient<Action> client;
    Recorder<ServoStatus> status;
    std::string enable_service;
  };

  /** A goal that waits for something is cancelled at once, and another one ends with its timeout. */
  template <typename Action>
  void expectToEnd(Driver<Action>& driver, const std::string& words)
  {
    using Clock = std::chrono::steady_clock;
    const auto done = [&] {
      return driver.client.getState().isDone();
    };
    const auto step = [this] {
      publish();
    };
    driver.send(60.0);
    ASSERT_TRUE(waitUntil(
        [&] { return driver.status.last() && driver.status.last()->reason.find(words) != std::string::npos; }, step))
        << (driver.status.last() ? driver.status.last()->reason : "no status");
    Clock::time_point moment = Clock::now();
    driver.client.cancelGoal();
    ASSERT_TRUE(waitUntil(done, step));
    EXPECT_LT(secondsSince(moment), STOPS_WITHIN);
    EXPECT_EQ(driver.client.getState().getText(), "the goal was cancelled");
    driver.send(1.0);
    moment = Clock::now();
    ASSERT_TRUE(waitUntil(done, step));
    EXPECT_LT(secondsSince(moment), 1.0 + STOPS_WITHIN);
    EXPECT_NE(driver.client.getState().getText().find(words), std::string::npos) << driver.client.getState().getText();
  }

  ros::NodeHandle nh_;
  const cv::Mat picture_ = texturedPicture(1);
  FakeCamera camera_;
  ros::Publisher clock_publisher_;
  ros::Publisher odometry_publisher_;
};

TEST_F(PausedClockTest, HomingGoesOnDeciding)
{
  Driver<HomeToViewAction> driver("homing", "home");
  expectToEnd(driver, "tf does not know");
}

TEST_F(PausedClockTest, ServoingGoesOnDeciding)
{
  Driver<ServoToViewAction> driver("servo_25d", "servo");
  expectToEnd(driver, "no homographies of view 'goal' have come");
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runDriverTests(argc, argv, "paused_clock_test", "homing", [] {
    return view_servo::test::viewOf("goal", view_servo::test::texturedPicture(1));
  });
}
