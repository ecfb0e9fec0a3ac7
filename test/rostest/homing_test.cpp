// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "homing_test.h"

#include "view_servo/Heading.h"

#include <chrono>
#include <cmath>

namespace view_servo
{
namespace test
{
namespace
{
INSTANTIATE_TYPED_TEST_SUITE_P(Homing, EveryDriverTest, FakeBase, );
INSTANTIATE_TYPED_TEST_SUITE_P(HomingDifferential, EveryDriverTest, FakeDifferentialBase, );

class HomingNodeTest : public DriverTest<FakeBase>
{
protected:
  using DriverTest<FakeBase>::DriverTest;
  HomingNodeTest() : DriverTest("driving", "cmd_vel")
  {
  }

  /** Odometry stops while the base drives, and stays away for longer than its stamps may be apart from images'. */
  void loseOdometryWhileDriving()
  {
    constexpr std::chrono::milliseconds LONG(1200);
    drive();
    expectToStop([this] { robot_.moves_odometry = false; }, ServoStatus::LOST, "no odometry");
    const Clock::time_point begin = Clock::now();
    EXPECT_TRUE(waitUntil([&] { return Clock::now() - begin > LONG; }));
  }

  Recorder<Heading> headings_{ ns_ + "/heading" };
};

TEST_F(HomingNodeTest, DrivesTowardsTheView)
{
  drive();
  const PlanarPose truth = inverse(scene().base);
  ASSERT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));
  const Heading heading = *headings_.last();
  EXPECT_EQ(heading.header.frame_id, sim::BASE_FRAME);
  EXPECT_NEAR(heading.heading, truth.heading(), 0.05);
  EXPECT_NEAR(heading.yaw_error, truth.yaw, 0.02);
  EXPECT_EQ(heading.histogram.size(), 181u);
  EXPECT_NE(heading.state, Heading::ARRIVED);
  const geometry_msgs::Twist twist = commands_.last();
  EXPECT_NEAR(std::atan2(twist.linear.y, twist.linear.x), truth.heading(), 0.05);
  EXPECT_LT(twist.angular.z, 0.0);
  EXPECT_LE(std::hypot(twist.linear.x, twist.linear.y), 0.25 + 1e-9);
  EXPECT_TRUE(waitUntil([this] { return status_.last()->state == ServoStatus::SERVOING; }));
}

TEST_F(HomingNodeTest, StopsWhenTheCameraStopsAndGoesOnWithIt)
{
  drive();
  expectToStopWhile(robot_.camera, "no image");
}

TEST_F(HomingNodeTest, SaysThatItIsTheCalibrationThatStopped)
{
  drive();
  expectToStopWhile(robot_.infos, "no camera_info comes on '/driving/camera_info'");
}

TEST_F(HomingNodeTest, StopsWhenOdometryStopsAndGoesOnWithIt)
{
  drive();
  expectToStopWhile(robot_.moves_odometry, "no odometry");
}

TEST_F(HomingNodeTest, WaitsForOdometryThatIsGoneForLongerThanStampsMayBeApart)
{
  loseOdometryWhileDriving();
  EXPECT_FALSE(client_.getState().isDone()) << reason();
  EXPECT_EQ(reason().find("apart"), std::string::npos) << reason();
  robot_.moves_odometry = true;
  expectToGoOn();
}

TEST_F(HomingNodeTest, DoesNotDriveByOdometryThatComesBackLate)
{
  loseOdometryWhileDriving();
  robot_.odometry_offset = -0.9;
  const Clock::time_point moment = Clock::now();
  expectToEnd([this] { robot_.moves_odometry = true; }, GoalState::ABORTED, "before the images on");
  EXPECT_LT(commands_.lastMotionAfter(moment), 0.0);
  robot_.odometry_offset = 0.0;
}

TEST_F(HomingNodeTest, RefusesAndStopsForOdometryOfAnotherTime)
{
  drive();
  expectToEnd([this] { robot_.odometry_offset = 2.0; }, GoalState::ABORTED, "after the images on", 2.0 * STOPS_WITHIN);
  const Clock::time_point moment = Clock::now();
  send("goal");
  EXPECT_TRUE(waitUntil([this] { return reason().find("their clocks are apart") != std::string::npos; })) << reason();
  EXPECT_LT(commands_.lastMotionAfter(moment), 0.0);
  expectToEnd([this] { robot_.odometry_offset = 0.0; }, GoalState::ABORTED, "gone back");
}

TEST_F(HomingNodeTest, StopsForImagesThatAreOldAsOdometryIs)
{
  drive();
  expectToStopForOldStamps(1.5, " ago, at most 1 s");
}

TEST_F(HomingNodeTest, DrivesThoughOdometryComesInTheWrongOrder)
{
  robot_.shuffles = true;
  drive();
  const Clock::time_point moment = Clock::now();
  constexpr double LONG = 3.0;  // than any patience with an input [s]
  EXPECT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(moment) > LONG; })) << reason();
  EXPECT_EQ(client_.getState().state_, GoalState::ACTIVE) << reason();
}

TEST_F(HomingNodeTest, StopsForOdometryOfTwoNodes)
{
  drive();
  const TemporaryDirectory directory;
  const std::string topic = ns_ + "/odom";
  std::unique_ptr<ChildProcess> other;
  const auto publish = [&] {
    other = std::make_unique<ChildProcess>(
        std::vector<std::string>{ "rostopic", "pub", "-r", "5", "/" + topic, "nav_msgs/Odometry", "{}" },
        directory.path() / "output");
  };
  publish();
  EXPECT_TRUE(waitUntil([this] { return reason().find("2 nodes publish odometry on") != std::string::npos; }))
      << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  other->interrupt();
  other.reset();
  expectToGoOn();
}

TEST_F(HomingNodeTest, UsesOdometryOfAFrameThatTfKnows)
{
  drive();
  expectToStop([this] { robot_.setFrames("base_footprint", sim::CAMERA_FRAME); }, ServoStatus::LOST,
               "is of 'base_footprint', ~base_frame is 'base_link'");
  robot_.placeBaseOn("base_footprint");
  expectToGoOn();
}

TEST_F(HomingNodeTest, KnowsFramesWithASlash)
{
  robot_.setFrames(std::string("/") + sim::BASE_FRAME, std::string("/") + sim::CAMERA_FRAME);
  drive();
  EXPECT_EQ(client_.getState().state_, GoalState::ACTIVE);
}

TEST_F(HomingNodeTest, SaysThatImagesHaveNoFrame)
{
  robot_.setFrames(sim::BASE_FRAME, "");
  send("goal");
  EXPECT_TRUE(waitUntil([this] { return reason().find("frame_id is empty") != std::string::npos; })) << reason();
  EXPECT_FALSE(commands_.moving());
}

TEST_F(HomingNodeTest, EndsWhenTheBaseDoesNotDoWhatItIsTold)
{
  drive();
  const Clock::time_point moment = Clock::now();
  robot_.blocked = true;
  expectToFail("the base does not do what it is told");
  EXPECT_LT(commands_.lastMotionAfter(moment), 2.0 + STOPS_WITHIN);
}

TEST_F(HomingNodeTest, StopsWhenTheImageTurnsBlackAndGoesOnAfterwards)
{
  drive();
  expectToStopWhile(robot_.black, "shows nothing");
}

TEST_F(HomingNodeTest, NeedsNoMatchesWhileThePointsAreTracked)
{
  drive();
  ASSERT_TRUE(waitUntil([this] { return reason().find("points are") != std::string::npos; })) << reason();
  robot_.answers = false;
  const auto silent = std::chrono::steady_clock::now();
  EXPECT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(silent) > 2.0; })) << reason();
  EXPECT_EQ(status_.last()->state, ServoStatus::SERVOING) << reason();
}

TEST_F(HomingNodeTest, StopsForMatchesOfAnotherView)
{
  drive();
  expectToStop([this] { robot_.other_view = true; }, ServoStatus::LOST, "are of view 'another', not of 'goal'");
}

TEST_F(HomingNodeTest, StopsWithoutACalibration)
{
  drive();
  expectToStop([this] { robot_.calibrated = false; }, ServoStatus::LOST, "not calibrated");
}

TEST_F(HomingNodeTest, RefusesAStepThatIsNone)
{
  HomeToViewGoal goal;
  goal.view = "goal";
  goal.step = -1.0;
  client_.sendGoal(goal);
  const auto final = expectToFail("negative");
  EXPECT_TRUE(std::isnan(final.final.heading));
  send("");
  EXPECT_NE(result().message.find("names no view"), std::string::npos);
}

class DifferentialHomingNodeTest : public DriverTest<FakeDifferentialBase>
{
};

TEST_F(DifferentialHomingNodeTest, NeverSlidesAndSaysWhatItDoes)
{
  const Recorder<HomeToViewActionFeedback> feedback(ns_ + "/home/feedback");
  drive();
  EXPECT_TRUE(waitUntil([&] { return feedback.last() && !feedback.last()->feedback.manoeuvre.empty(); }));
  EXPECT_TRUE(commands_.all([](const geometry_msgs::Twist& twist) { return twist.linear.y == 0.0; }));
}

class DryHomingNodeTest : public DryDriverTest<FakeBase>
{
protected:
  Recorder<Heading> headings_{ "dry/heading" };
};

TEST_F(DryHomingNodeTest, WatchesItsViewAndKeepsCommandsToItself)
{
  // Without any goal.
  EXPECT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));
  EXPECT_FALSE(commands_.moving());
  enable(false);
  send("");
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  EXPECT_FALSE(real_commands_.any());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  using view_servo::test::scene;
  return view_servo::test::runDriverTests(argc, argv, "homing_test", "driving/homing",
                                          [] { return view_servo::test::viewOf("goal", scene().view); });
}
