// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "arm_servo_test.h"

#include "view_servo/ServoToViewAction.h"
#include "view_servo/WantedView.h"

#include <gtest/gtest.h>

#include <algorithm>
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
/** Goals with two views: a wide approach, which the camera is at, and the goal, which it is not. */
class ServoViewsTest : public Servo25dNodeTest
{
protected:
  void SetUp() override
  {
    Servo25dNodeTest::SetUp();
    StoredView view = viewOf(FIRST_VIEW, texturedPicture(2));
    view.region = REGION;
    saveView(ns_ + "/servo_25d", view);
    robot_.offset = 0.02;
  }

  static ServoView wanted(const std::string& view, double translation_tolerance = 0.0)
  {
    ServoView result;
    result.view = view;
    result.translation_tolerance = translation_tolerance;
    return result;
  }

  void sendViews(const std::vector<ServoView>& views)
  {
    ServoToViewGoal goal;
    goal.views = views;
    goal.timeout = 60.0;
    client_.sendGoal(goal, {}, {}, [this](const ServoToViewFeedbackConstPtr& feedback) {
      const std::lock_guard<std::mutex> lock(feedback_mutex_);
      feedback_.push_back(*feedback);
    });
  }

  void sendBoth()
  {
    sendViews({ wanted(FIRST_VIEW, 0.03), wanted("goal") });
  }

  /** Until the tracker is asked for the second view, and the driver waits for it. */
  void waitBetween()
  {
    ASSERT_TRUE(waitUntil([this] { return robot_.wantedView().view == "goal"; })) << reason();
    ASSERT_TRUE(waitUntil([this] { return reason().find("view 'goal', 2 of 2: ") == 0; })) << reason();
    ASSERT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  void driveToSecond()
  {
    sendBoth();
    ASSERT_TRUE(waitUntil([this] {
      return commands_.moving() && reason() == "view 'goal', 2 of 2: drives to the view";
    })) << reason();
  }

  std::vector<ServoToViewFeedback> feedback()
  {
    const std::lock_guard<std::mutex> lock(feedback_mutex_);
    return feedback_;
  }

  /** The goal that was sent must be refused, by these words, before anything moves or any view is asked for. */
  void expectToBeRefused(const std::string& words)
  {
    EXPECT_EQ(expectToFail(words).reached, 0);
    EXPECT_FALSE(commands_.moving());
    const auto asked = views_.messages();
    EXPECT_TRUE(
        std::all_of(asked.begin(), asked.end(), [](const WantedView& message) { return message.view.empty(); }));
  }

  Recorder<WantedView> views_{ ns_ + "/servo_25d/wanted_view" };

private:
  std::mutex feedback_mutex_;
  std::vector<ServoToViewFeedback> feedback_;
};

TEST_F(ServoViewsTest, DrivesToOneAfterTheOther)
{
  driveToSecond();
  robot_.offset = 2e-4;
  const ServoToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(final.reached, 2);
  EXPECT_EQ(final.message.find("view 'goal', 2 of 2: "), 0U) << final.message;
  const std::vector<ServoToViewFeedback> told = feedback();
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.front().view, FIRST_VIEW);
  EXPECT_EQ(told.front().number, 1);
  EXPECT_EQ(told.back().view, "goal");
  EXPECT_EQ(told.back().number, 2);
  for (const ServoToViewFeedback& feedback : told)
  {
    EXPECT_EQ(feedback.count, 2);
    EXPECT_EQ(feedback.view, feedback.number == 1 ? FIRST_VIEW : "goal");
  }
  // Both were asked for, for one goal, and nothing afterwards.
  std::vector<std::string> asked;
  std::set<std::string> goals;
  for (const WantedView& message : views_.messages())
  {
    if (!message.view.empty())
    {
      asked.push_back(message.view);
      goals.insert(message.goal);
    }
  }
  EXPECT_EQ(goals.size(), 1U);
  EXPECT_EQ(asked, (std::vector<std::string>{ FIRST_VIEW, "goal" }));
}

TEST_F(ServoViewsTest, AsksEachViewForItsOwnTolerance)
{
  sendViews({ wanted(FIRST_VIEW, 0.03), wanted("goal") });
  ASSERT_TRUE(waitUntil([this] { return robot_.wantedView().view == "goal"; })) << reason();
  const Clock::time_point moment = Clock::now();
  ASSERT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(moment) > 1.5; })) << reason();
  EXPECT_EQ(reason().find("view 'goal', 2 of 2: "), 0U) << reason();
  robot_.offset = 2e-4;
  EXPECT_TRUE(result().success);
}

TEST_F(ServoViewsTest, IsCancelledBetweenViews)
{
  robot_.keeps_to_first = true;
  sendBoth();
  waitBetween();
  EXPECT_TRUE(waitUntil([this] { return reason().find("are of view 'approach', not of 'goal'") != std::string::npos; }))
      << reason();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 1);
}

TEST_F(ServoViewsTest, IsCancelledOnTheWayToEach)
{
  robot_.offset = 0.1;
  sendBoth();
  ASSERT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 0);
  robot_.offset = 0.02;
  driveToSecond();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 1);
}

TEST_F(ServoViewsTest, StandsBetweenViewsUntilTheTrackerAnswers)
{
  robot_.keeps_to_first = true;
  sendBoth();
  waitBetween();
  robot_.keeps_to_first = false;
  expectToGoOn();
}

TEST_F(ServoViewsTest, GivesUpWhenTheTrackerDoesNotTurnToTheNextView)
{
  robot_.keeps_to_first = true;
  sendBoth();
  EXPECT_EQ(expectToFail("view 'goal', 2 of 2: the view is not found within 4 s").reached, 1);
}

TEST_F(ServoViewsTest, EndsWhenTheTrackerRefusesTheNextView)
{
  robot_.refuses_second = true;
  sendBoth();
  EXPECT_EQ(expectToFail("view 'goal', 2 of 2: homographies on").reached, 1);
  EXPECT_NE(client_.getResult()->message.find("it is gone"), std::string::npos);
}

TEST_F(ServoViewsTest, StopsForTheSameFaultsAtEachView)
{
  driveToSecond();
  expectToStopWhile(robot_.covered, "a hand is in front of it");
  expectToStop([this] { robot_.hush(true); }, ServoStatus::LOST, FakeArm::SILENT);
  robot_.hush(false);
  expectToGoOn();
  // That the tracker has gone back to the view before is no answer that comes late.
  expectToEnd([this] { robot_.keeps_to_first = true; }, GoalState::ABORTED, "are of view 'approach', not of 'goal'");
}

TEST_F(ServoViewsTest, RefusesAListWithAViewThatIsNotThere)
{
  sendViews({ wanted(FIRST_VIEW, 0.03), wanted("unknown") });
  expectToBeRefused("unknown");
}

TEST_F(ServoViewsTest, RefusesAListWithAViewThatCannotBeRead)
{
  StoredView view = viewOf("damaged", texturedPicture(3));
  saveView(ns_ + "/servo_25d", view);
  for (const auto& file : std::filesystem::directory_iterator(viewsDir(ns_ + "/servo_25d")))
  {
    if (file.path().filename().string().find("damaged.") == 0 && file.path().extension() == ".png")
    {
      std::filesystem::resize_file(file.path(), 100);
    }
  }
  sendViews({ wanted(FIRST_VIEW, 0.03), wanted("damaged") });
  expectToBeRefused("damaged");
}

TEST_F(ServoViewsTest, RefusesAListThatIsNoOrder)
{
  sendViews({ wanted(FIRST_VIEW, -0.03), wanted("goal") });
  expectToBeRefused("tolerances, dwell and timeout must be finite and not negative");
  sendViews({ wanted(FIRST_VIEW), wanted("") });
  expectToBeRefused("''");
  ServoToViewGoal goal;
  goal.view = "goal";
  goal.views = { wanted(FIRST_VIEW) };
  client_.sendGoal(goal);
  expectToBeRefused("both a view and a list of views");
}

}  // namespace
}  // namespace test
}  // namespace view_servo
