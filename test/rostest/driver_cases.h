// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "change_parameters.h"
#include "driver_test.h"

#include <std_msgs/Bool.h>

#include <chrono>
#include <limits>
#include <map>
#include <string>

namespace view_servo
{
namespace test
{
/** @file What every driver must do, whatever its robot is: instantiated by the test of each. */

template <typename Robot>
class EveryDriverTest : public DriverTest<Robot>
{
protected:
  std::map<std::string, double> change(const std::map<std::string, double>& wanted) const
  {
    return changeParameters(this->ns_ + "/" + Robot::DRIVER, wanted);
  }
};

TYPED_TEST_SUITE_P(EveryDriverTest);

using actionlib::SimpleClientGoalState;

// ------------------------------------------------------------------------------------------------- while it prepares

TYPED_TEST_P(EveryDriverTest, WaitsForAPeerThatAnswersLate)
{
  this->prepareInVain();
  EXPECT_FALSE(this->commands_.moving());
  this->robot_.answers = true;
  this->expectToGoOn();
}

TYPED_TEST_P(EveryDriverTest, EndsInTimeWhenThePeerNeverAnswers)
{
  this->prepareInVain(1.5);
  const auto final = this->expectToFail("not begun within 1.5 s");
  EXPECT_NE(final.message.find(TypeParam::SILENT), std::string::npos) << final.message;
  EXPECT_LT(final.duration, 1.5 + STOPS_WITHIN);
}

TYPED_TEST_P(EveryDriverTest, IsCancelledWhileItPrepares)
{
  this->prepareInVain();
  this->expectToEnd([this] { this->client_.cancelGoal(); }, SimpleClientGoalState::PREEMPTED, "cancelled");
  EXPECT_TRUE(this->robot_.wantedView().view.empty() ||
              waitUntil([this] { return this->robot_.wantedView().view.empty(); }));
}

TYPED_TEST_P(EveryDriverTest, IsDisabledWhileItPrepares)
{
  this->prepareInVain();
  this->expectToEnd([this] { this->enable(false); }, SimpleClientGoalState::ABORTED, "disabled");
  EXPECT_TRUE(waitUntil([this] { return this->status_.last()->state == ServoStatus::DISABLED; }));
}

TYPED_TEST_P(EveryDriverTest, IsReplacedWhileItPrepares)
{
  this->prepareInVain();
  typename TestFixture::Client other(this->ns_ + "/" + TypeParam::ACTION, false);
  ASSERT_TRUE(waitUntil([&] { return other.isServerConnected(); }));
  typename TestFixture::Goal goal;
  goal.view = "goal";
  this->expectToEnd([&] { other.sendGoal(goal); }, SimpleClientGoalState::PREEMPTED, "another goal has come");
  this->robot_.refuses = true;
  this->robot_.answers = true;
  EXPECT_TRUE(waitUntil([&] { return other.getState().isDone(); }));
  EXPECT_NE(other.getState().getText().find("it is too dark"), std::string::npos) << other.getState().getText();
}

TYPED_TEST_P(EveryDriverTest, EndsItsProcessWhileItPrepares)
{
  typename TestFixture::OtherDriver other(this->viewsDirectory());
  other.robot.answers = false;
  other.send("goal");
  ASSERT_TRUE(waitUntil([&] {
    return other.status.last() && other.status.last()->reason.find(TypeParam::SILENT) != std::string::npos;
  })) << other.node.output();
  other.expectToEnd([&] { other.node.interrupt(); });
}

TYPED_TEST_P(EveryDriverTest, RefusesAViewThatItsPeerRefuses)
{
  this->robot_.refuses = true;
  this->send("goal");
  this->expectToFail("it is too dark");
}

TYPED_TEST_P(EveryDriverTest, RefusesAViewThatIsNotThere)
{
  this->expectToEnd([this] { this->send("unknown"); }, SimpleClientGoalState::ABORTED, "unknown", 2.0 * SLOWDOWN);
}

TYPED_TEST_P(EveryDriverTest, RefusesWhenDisabled)
{
  this->enable(false);
  this->expectToEnd([this] { this->send("goal"); }, SimpleClientGoalState::ABORTED, "call ~enable", 2.0 * SLOWDOWN);
}

TYPED_TEST_P(EveryDriverTest, RefusesTimesThatAreNone)
{
  this->send("goal", std::numeric_limits<double>::quiet_NaN());
  EXPECT_NE(this->result().message.find("finite"), std::string::npos);
  this->send("goal", -1.0);
  EXPECT_NE(this->result().message.find("negative"), std::string::npos);
}

// ---------------------------------------------------------------------------------------------------- while it drives

TYPED_TEST_P(EveryDriverTest, StopsWhenDisabled)
{
  this->drive();
  const auto disable = [this] {
    this->enable(false);
    this->enable(true);  // before the next cycle of control
  };
  this->expectToEnd(disable, SimpleClientGoalState::ABORTED, "disabled");
  EXPECT_TRUE(waitUntil([this] { return this->status_.last()->state == ServoStatus::IDLE; }));
  this->enable(false);
  EXPECT_TRUE(waitUntil([this] { return this->status_.last()->state == ServoStatus::DISABLED; }));
}

TYPED_TEST_P(EveryDriverTest, StopsWhenTheGoalIsCancelled)
{
  this->drive();
  this->expectToEnd([this] { this->client_.cancelGoal(); }, SimpleClientGoalState::PREEMPTED, "cancelled");
  this->enable(false);  // which does not hide how the goal ended
  EXPECT_TRUE(waitUntil([this] {
    const ServoStatus status = *this->status_.last();
    return status.state == ServoStatus::DISABLED && status.reason.find("; the last goal: ") != std::string::npos;
  }));
}

TYPED_TEST_P(EveryDriverTest, StopsForAnotherGoal)
{
  this->drive();
  typename TestFixture::Client other(this->ns_ + "/" + TypeParam::ACTION, false);
  ASSERT_TRUE(waitUntil([&] { return other.isServerConnected(); }));
  typename TestFixture::Goal goal;
  goal.view = "unknown";
  this->expectToEnd([&] { other.sendGoal(goal); }, SimpleClientGoalState::PREEMPTED, "another goal has come");
  EXPECT_TRUE(waitUntil([&] { return other.getState().isDone(); }));
}

TYPED_TEST_P(EveryDriverTest, StopsBeforeItsProcessEnds)
{
  for (const bool by_signal_of_a_person : { true, false })
  {
    typename TestFixture::OtherDriver other(this->viewsDirectory());
    other.send("goal");
    ASSERT_TRUE(waitUntil([&] { return other.commands.moving(); })) << other.node.output();
    other.expectToEnd([&] { by_signal_of_a_person ? other.node.interrupt() : other.node.terminate(); });
  }
}

TYPED_TEST_P(EveryDriverTest, GivesUpInTime)
{
  this->drive();
  this->send("goal", 1.0);  // replaces the other
  const auto final = this->expectToFail("within 1 s");
  EXPECT_GE(final.duration, 1.0);
}

TYPED_TEST_P(EveryDriverTest, KeepsLimitsThatPeopleChangeWhileItDrives)
{
  constexpr double SLOW = 0.002;  // [m/s, rad/s]
  constexpr std::chrono::milliseconds AT_ONCE(static_cast<int>(100.0 * SLOWDOWN));
  this->drive();
  const auto set = [&](double most) {
    return this->change({ { "max_speed", most }, { "max_turn_rate", most } })["max_speed"];
  };
  EXPECT_EQ(set(SLOW), SLOW);
  const auto changed = std::chrono::steady_clock::now() + AT_ONCE;
  EXPECT_TRUE(waitUntil([&] { return this->commands_.lastMotionAfter(changed) > 0.2; })) << this->reason();
  EXPECT_LE(this->commands_.fastestAfter(changed), SLOW * (1.0 + 1e-9));
  const double most = set(1e9);
  EXPECT_GT(most, SLOW);
  EXPECT_LT(most, 1.0) << "no more than it was started with";
  EXPECT_TRUE(waitUntil([&] { return this->commands_.fastestAfter(changed) > SLOW; })) << this->reason();
  EXPECT_EQ(set(std::numeric_limits<double>::quiet_NaN()), most);
}

TYPED_TEST_P(EveryDriverTest, TakesGainsThatPeopleChangeWhileItDrives)
{
  const std::map<std::string, double> started = this->change({});
  std::map<std::string, double> gains;
  for (const auto& [name, value] : started)
  {
    if (name.find("gain") != std::string::npos)
    {
      gains[name] = 0.1 * value;
    }
  }
  ASSERT_EQ(gains.size(), 2U);
  std::map<std::string, double> live = this->change(gains);
  for (const auto& [name, gain] : gains)
  {
    EXPECT_NEAR(live[name], gain, 1e-9) << name;
  }
  this->drive();
  const auto before = std::chrono::steady_clock::now();
  EXPECT_TRUE(waitUntil([&] { return this->commands_.lastMotionAfter(before) > 0.3; })) << this->reason();
  const double slow = this->commands_.fastestAfter(before);
  const auto changed = std::chrono::steady_clock::now();
  EXPECT_EQ(this->change(started), started);
  EXPECT_TRUE(waitUntil([&] { return this->commands_.fastestAfter(changed) > 1.4 * slow; }))
      << slow << ' ' << this->commands_.fastestAfter(changed) << ' ' << this->reason();
  EXPECT_NEAR(this->change({ { "gain", 1e9 } })["gain"], 2.0 * started.at("gain"), 1e-9);
  EXPECT_EQ(this->change(started), started);
}

TYPED_TEST_P(EveryDriverTest, StopsWhenThePeerFallsSilentAndGoesOnWithIt)
{
  this->drive();
  this->expectToStop([this] { this->robot_.hush(true); }, ServoStatus::LOST, TypeParam::SILENT);
  this->robot_.hush(false);
  this->expectToGoOn();
}

TYPED_TEST_P(EveryDriverTest, GivesUpWhenThePeerStaysSilent)
{
  this->drive();
  this->robot_.hush(true);
  this->expectToFail(TypeParam::SILENT);
}

TYPED_TEST_P(EveryDriverTest, StopsWhenTimeGoesBack)
{
  this->drive();
  this->expectToEnd([this] { this->robot_.delay = 5.0; }, SimpleClientGoalState::ABORTED, "gone back");
}

TYPED_TEST_P(EveryDriverTest, StopsForStampsThatStandStill)
{
  this->drive();
  this->expectToStopWhile(this->robot_.frozen, "stand still");
}

TYPED_TEST_P(EveryDriverTest, StopsForStampsThatAreZero)
{
  this->drive();
  this->expectToStop([this] { this->robot_.unstamped = true; }, ServoStatus::LOST, "no stamp");
  this->expectToFail("no stamp");
}

TYPED_TEST_P(EveryDriverTest, StopsWhenTheCalibrationChanges)
{
  this->drive();
  this->expectToEnd([this] { this->robot_.focal_length = 510.0; }, SimpleClientGoalState::ABORTED,
                    "calibration has changed", 2.0 * STOPS_WITHIN);
}

TYPED_TEST_P(EveryDriverTest, StopsWhenNobodyFollowsAnyMore)
{
  this->drive();
  this->commands_.shutdown();
  EXPECT_TRUE(waitUntil([this] { return this->client_.getState().isDone(); })) << this->reason();
  EXPECT_NE(this->client_.getState().getText().find("nobody listens any more"), std::string::npos)
      << this->client_.getState().getText();
  this->send("goal", 1.5);
  this->expectToFail("nobody listens on");
}

TYPED_TEST_P(EveryDriverTest, StandsWhileItIsHeld)
{
  ros::Publisher stop = ros::NodeHandle(this->ns_).advertise<std_msgs::Bool>("stop", 1, true);
  std_msgs::Bool message;
  this->drive();
  message.data = 1;
  ASSERT_TRUE(waitUntil([&] { return stop.getNumSubscribers() > 0; }));
  this->expectToStop([&] { stop.publish(message); }, ServoStatus::LOST, "held: the last word on");
  message.data = 0;
  stop.publish(message);
  this->expectToGoOn();
}

TYPED_TEST_P(EveryDriverTest, SurvivesWhateverIsInMessages)
{
  this->robot_.publishExtremes();  // without a goal
  this->driveAfterExtremes();
  this->robot_.publishExtremes();  // with one: it may end it, by a reason
  this->client_.cancelAllGoals();
  EXPECT_TRUE(waitUntil([this] { return this->client_.getState().isDone(); })) << this->reason();
  EXPECT_FALSE(this->client_.getState().getText().empty());
  EXPECT_TRUE(waitUntil([this] { return !this->commands_.moving(); }));
  this->driveAfterExtremes();  // and it goes on
}

TYPED_TEST_P(EveryDriverTest, TakesManyGoalsWhilePeersComeAndGo)
{
  const char* wanted = std::getenv("VIEW_SERVO_GOALS");
  const int goals = wanted != nullptr ? std::atoi(wanted) : 200;
  for (int i = 0; i < goals && !this->HasFatalFailure(); ++i)
  {
    if (i % 5 == 0)
    {
      this->robot_.reconnect();
    }
    this->robot_.answers = i % 3 != 0;
    this->send("goal", i % 7 == 0 ? 0.05 : 60.0);
    if (i % 2 == 0)
    {
      this->client_.cancelGoal();
    }
    else if (i % 7 != 0)
    {
      ASSERT_TRUE(waitUntil([this] { return this->client_.getState() != SimpleClientGoalState::PENDING; })) << i;
      this->client_.cancelGoal();
    }
    ASSERT_TRUE(waitUntil([this] { return this->client_.getState().isDone(); }))
        << "goal " << i << ": " << this->reason();
    // One that is cancelled before the driver could see it is ended by actionlib itself, without a word.
    const SimpleClientGoalState state = this->client_.getState();
    const bool seen = state != SimpleClientGoalState::RECALLED && state != SimpleClientGoalState::LOST;
    ASSERT_TRUE(!seen || !state.getText().empty()) << "goal " << i << ": " << state.toString();
  }
  this->robot_.answers = true;
  this->drive();
}

REGISTER_TYPED_TEST_SUITE_P(EveryDriverTest, WaitsForAPeerThatAnswersLate, EndsInTimeWhenThePeerNeverAnswers,
                            IsCancelledWhileItPrepares, IsDisabledWhileItPrepares, IsReplacedWhileItPrepares,
                            EndsItsProcessWhileItPrepares, RefusesAViewThatItsPeerRefuses, RefusesAViewThatIsNotThere,
                            RefusesWhenDisabled, RefusesTimesThatAreNone, StopsWhenDisabled,
                            StopsWhenTheGoalIsCancelled, StopsForAnotherGoal, StopsBeforeItsProcessEnds, GivesUpInTime,
                            KeepsLimitsThatPeopleChangeWhileItDrives, TakesGainsThatPeopleChangeWhileItDrives,
                            StopsWhenThePeerFallsSilentAndGoesOnWithIt, GivesUpWhenThePeerStaysSilent,
                            StopsWhenTimeGoesBack, StopsForStampsThatStandStill, StopsForStampsThatAreZero,
                            StopsWhenTheCalibrationChanges, StopsWhenNobodyFollowsAnyMore, StandsWhileItIsHeld,
                            SurvivesWhateverIsInMessages, TakesManyGoalsWhilePeersComeAndGo);

}  // namespace test
}  // namespace view_servo
