// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A goal with several views: homing drives to one after the other. */
#include "driver_test.h"
#include "simulated_base_test.h"

#include "view_servo/HomeToViewAction.h"

#include <actionlib/client/simple_action_client.h>
#include <std_srvs/SetBool.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
class HomingViewsTest : public SimulatedBaseTest
{
protected:
  void send(const std::vector<std::string>& views, const std::string& view = "")
  {
    HomeToViewGoal goal;
    goal.views = views;
    goal.view = view;
    goal.timeout = 90.0;
    std_srvs::SetBool::Request open;
    open.data = 1;
    ASSERT_TRUE(waitForService("homing/enable"));
    ASSERT_TRUE(answerOf<std_srvs::SetBool>("homing/enable", open).success);
    ASSERT_TRUE(waitUntil([this] { return client_.isServerConnected(); }));
    client_.sendGoal(goal, {}, {}, [this](const HomeToViewFeedbackConstPtr& feedback) {
      const std::lock_guard<std::mutex> lock(feedback_mutex_);
      feedback_.push_back(*feedback);
    });
  }

  HomeToViewResult result()
  {
    EXPECT_TRUE(waitUntil([this] { return client_.getState().isDone(); }));
    const HomeToViewResultConstPtr result = client_.getResult();
    return result ? *result : HomeToViewResult();
  }

  /** The names of the views that were asked for, in a row, for goals. */
  std::vector<std::string> asked() const
  {
    std::vector<std::string> names;
    for (const WantedView& message : wanted_.messages())
    {
      if (!message.goal.empty() && (names.empty() || names.back() != message.view))
      {
        names.push_back(message.view);
      }
    }
    return names;
  }

  std::vector<HomeToViewFeedback> feedback()
  {
    const std::lock_guard<std::mutex> lock(feedback_mutex_);
    return feedback_;
  }

private:
  actionlib::SimpleActionClient<HomeToViewAction> client_{ "home" };
  std::mutex feedback_mutex_;
  std::vector<HomeToViewFeedback> feedback_;
};

TEST_F(HomingViewsTest, DrivesToOneAfterTheOther)
{
  const geometry_msgs::Point far = position();
  save("far");
  ASSERT_TRUE(driveBack(0.25));
  ASSERT_TRUE(waitUntil([this] { return std::abs(odometry_.last()->twist.twist.linear.x) < 1e-6; }));
  const geometry_msgs::Point near = position();
  save("near");
  ASSERT_TRUE(driveBack(0.2));

  send({ "near", "far" });
  double nearest = distance(position(), near);
  ASSERT_TRUE(waitUntil([&] {
    nearest = std::min(nearest, distance(position(), near));
    const std::vector<std::string> names = asked();
    return !names.empty() && names.back() == "far";
  }));
  EXPECT_LT(nearest, 0.03);
  const HomeToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(final.message.find("view 'far', 2 of 2: "), 0U) << final.message;
  EXPECT_EQ(final.reached, 2);
  EXPECT_GT(final.travelled, distance(near, far)) << "of the whole way";
  EXPECT_LT(distance(position(), far), 0.03);
  EXPECT_EQ(asked(), (std::vector<std::string>{ "near", "far" }));
  const std::vector<HomeToViewFeedback> told = feedback();
  ASSERT_FALSE(told.empty());
  for (const HomeToViewFeedback& one : told)
  {
    EXPECT_EQ(one.count, 2);
    EXPECT_EQ(one.view, one.number == 1 ? "near" : "far");
  }
  EXPECT_EQ(told.front().number, 1);
  EXPECT_EQ(told.back().number, 2);
}

TEST_F(HomingViewsTest, RefusesAListBeforeAnythingMoves)
{
  save("known");
  const geometry_msgs::Point start = position();
  send({ "known", "unknown" });
  const HomeToViewResult unknown = result();
  EXPECT_FALSE(unknown.success);
  EXPECT_NE(unknown.message.find("unknown"), std::string::npos) << unknown.message;
  EXPECT_EQ(unknown.reached, 0);
  send({ "known" }, "known");
  const HomeToViewResult both = result();
  EXPECT_FALSE(both.success);
  EXPECT_NE(both.message.find("leave one of them empty"), std::string::npos) << both.message;
  EXPECT_TRUE(asked().empty());
  EXPECT_LT(distance(position(), start), 1e-6);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
