// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "arm_servo_test.h"
#include "driver_cases.h"

#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"

#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
INSTANTIATE_TYPED_TEST_SUITE_P(Servo25d, EveryDriverTest, FakeArm, );

TEST_F(Servo25dNodeTest, DrivesTowardsTheView)
{
  drive();
  const geometry_msgs::TwistStamped command = commands_.last();
  EXPECT_EQ(command.header.frame_id, CAMERA_FRAME);
  EXPECT_EQ(commands_.first().header.frame_id, CAMERA_FRAME);  // that of the calibration, before any homography
  EXPECT_GT(command.twist.linear.x, 0.0);
  EXPECT_LT(std::abs(command.twist.linear.y), 1e-6);
  EXPECT_LE(toVector(command.twist.linear).norm(), 0.15 + 1e-9);
  ASSERT_TRUE(waitUntil([this] { return errors_.last() && errors_.last()->twist.linear.x > 0.0; }));
  const ServoError error = *errors_.last();
  EXPECT_EQ(error.header.frame_id, CAMERA_FRAME);
  EXPECT_EQ(error.view, "goal");
  EXPECT_EQ(error.wanted_x, 250.0);
  EXPECT_EQ(error.wanted_y, 180.0);
  EXPECT_LE(error.translation_error, 0.1 + 1e-6);
  EXPECT_GE(error.translation_error, 0.08) << "it has moved a little meanwhile";
  EXPECT_NEAR(error.error_x, error.translation_error / 0.5, 1e-6);
  EXPECT_NEAR(error.point_x, 250.0 + 500.0 * error.error_x, 1e-6);
  EXPECT_NEAR(error.rotation_error, 0.0, 1e-6);
  EXPECT_TRUE(waitUntil([this] { return status_.last()->state == ServoStatus::SERVOING; }));
  EXPECT_EQ(status_.last()->inliers, 50);
}

TEST_F(Servo25dNodeTest, EndsAtTheView)
{
  drive();
  robot_.offset = 2e-4;
  const ServoToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(client_.getState().state_, GoalState::SUCCEEDED);
  EXPECT_EQ(final.final.state, ServoStatus::CONVERGED);
  EXPECT_EQ(final.final.reason, final.message);
  EXPECT_NEAR(final.final.translation_error, 2e-4, 1e-6);
  EXPECT_GT(final.iterations, 0);
  EXPECT_GE(final.duration, 0.5);
  EXPECT_TRUE(waitUntil([this] { return robot_.wantedView().view.empty(); }));
}

TEST_F(Servo25dNodeTest, StopsWhenTheViewIsCoveredAndGoesOnAfterwards)
{
  drive();
  expectToStopWhile(robot_.covered, "a hand is in front of it");
}

TEST_F(Servo25dNodeTest, GivesUpWhenTheViewStaysCovered)
{
  drive();
  robot_.covered = true;
  const auto final = expectToFail("the view is lost: a hand is in front of it");
  EXPECT_EQ(final.final.state, ServoStatus::ABORTED);
}

TEST_F(Servo25dNodeTest, StopsForOldHomographies)
{
  drive();
  expectToStopForOldStamps(0.9, " old");
}

TEST_F(Servo25dNodeTest, StopsForHomographiesOfAnotherView)
{
  drive();
  expectToEnd([this] { robot_.other_view = true; }, GoalState::ABORTED, "are of view 'another', not of 'goal'");
}

TEST_F(Servo25dNodeTest, StopsForNonsense)
{
  drive();
  expectToStop([this] { robot_.nonsense = true; }, ServoStatus::LOST,
               "are not used: its rotation is no unit quaternion");
}

TEST_F(Servo25dNodeTest, StopsAtAJointLimit)
{
  drive();
  expectToEnd([this] { robot_.joint = 1.74; }, GoalState::ABORTED, "joint limit reached: 'joint5' is at 1.740",
              2.0 * STOPS_WITHIN);
}

TEST_F(Servo25dNodeTest, ForgetsAJointThatIsNotHeardOfAnyMore)
{
  drive();
  expectToEnd([this] { robot_.joint = 1.74; }, GoalState::ABORTED, "joint limit reached", 2.0 * STOPS_WITHIN);
  robot_.joints_come = false;
  // As soon as what was said of the joint is old, it hinders nobody.
  EXPECT_TRUE(waitUntil([this] {
    send("goal");
    waitUntil([this] { return commands_.moving() || client_.getState().isDone(); });
    return commands_.moving() && !client_.getState().isDone();
  })) << reason();
}

TEST_F(Servo25dNodeTest, DoesWithoutJointStatesThatNeverCome)
{
  robot_.joints_come = false;
  const Clock::time_point moment = Clock::now();
  const auto drives_on = [&] {
    return commands_.lastMotionAfter(moment) > 4.0;
  };
  // What former tests published is forgotten first.
  EXPECT_TRUE(waitUntil(drives_on, [this] {
    if (!commands_.any() || client_.getState().isDone() || reason().find("no joint states") != std::string::npos)
    {
      send("goal");
      waitUntil([this] { return commands_.moving(); });
    }
  })) << reason();
}

TEST_F(Servo25dNodeTest, StopsWhenJointStatesStopAndGoesOnWithThem)
{
  drive();
  robot_.joints_come = false;
  EXPECT_TRUE(waitUntil([this] { return reason().find("no joint states for") != std::string::npos; })) << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  robot_.joints_come = true;
  expectToGoOn();
}

TEST_F(Servo25dNodeTest, StopsForAJointThatIsNowhere)
{
  drive();
  robot_.joint = 99.0;
  EXPECT_TRUE(waitUntil([this] { return reason().find("'joint5' is said to be at 99") != std::string::npos; }))
      << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
}

TEST_F(Servo25dNodeTest, StopsWithoutACalibration)
{
  drive();
  expectToEnd([this] { robot_.calibrated = false; }, GoalState::ABORTED, "not calibrated");
  send("goal");
  EXPECT_NE(result().message.find("not calibrated"), std::string::npos);
}

using DryServo25dNodeTest = DryDriverTest<FakeArm>;

TEST_F(DryServo25dNodeTest, KeepsCommandsToItself)
{
  enable(false);
  drive();
  EXPECT_FALSE(real_commands_.any());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runDriverTests(argc, argv, "arm_servo_test", "driving/servo_25d", [] {
    view_servo::StoredView view = view_servo::test::viewOf("goal", view_servo::test::texturedPicture(1));
    view.region = view_servo::test::REGION;
    return view;
  });
}
