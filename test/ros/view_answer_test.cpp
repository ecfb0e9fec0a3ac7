// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/view_answer.h"
#include "view_servo/PointMatches.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
PointMatches about(const std::string& view, const std::string& goal, const std::string& refusal = "")
{
  PointMatches message;
  message.view = view;
  message.goal = goal;
  message.refused = refusal.empty() ? 0 : 1;
  message.reason = refusal;
  return message;
}

class ViewAnswerTest : public ::testing::Test
{
protected:
  ViewAnswer answer_{ "matches", "/point_matches" };
};

TEST_F(ViewAnswerTest, IsNothingWhenNothingIsWanted)
{
  EXPECT_FALSE(answer_.add(about("dock", "")));
  EXPECT_FALSE(answer_.came());
}

TEST_F(ViewAnswerTest, ComesOfTheGoalOrOfSomebodyWhoChoseTheSameView)
{
  for (const std::string goal : { "goal 2", "" })
  {
    answer_.expect("dock", "goal 2");
    EXPECT_NE(answer_.missing().find("no matches of view 'dock' have come on '/point_matches'"), std::string::npos);
    EXPECT_TRUE(answer_.add(about("dock", goal)));
    EXPECT_TRUE(answer_.came());
    EXPECT_EQ(answer_.missing(), "");
  }
}

TEST_F(ViewAnswerTest, IsNotThatOfAFormerGoal)
{
  answer_.expect("dock", "goal 2");
  EXPECT_FALSE(answer_.add(about("dock", "goal 1")));
  EXPECT_FALSE(answer_.add(about("dock", "goal 1", "it is gone")));
  EXPECT_FALSE(answer_.came());
  EXPECT_EQ(answer_.refusal(), "");
  EXPECT_EQ(answer_.otherView(), "");
}

TEST_F(ViewAnswerTest, NamesAnotherView)
{
  answer_.expect("dock", "goal 2");
  EXPECT_FALSE(answer_.add(about("door", "")));
  EXPECT_NE(answer_.missing().find("are of view 'door', not of 'dock'"), std::string::npos);
  EXPECT_TRUE(answer_.add(about("dock", "")));
  EXPECT_EQ(answer_.otherView(), "");
}

TEST_F(ViewAnswerTest, RefusesForAReason)
{
  answer_.expect("dock", "goal 2");
  EXPECT_FALSE(answer_.add(about("dock", "goal 2", "there is no such view")));
  EXPECT_NE(answer_.refusal().find("there is no such view"), std::string::npos);
  EXPECT_THROW(missingAnswer({ &answer_ }), std::runtime_error);
  EXPECT_TRUE(answer_.add(about("dock", "goal 2")));  // it was stored meanwhile
  EXPECT_EQ(missingAnswer({ &answer_ }), "");
}

TEST_F(ViewAnswerTest, OneOfSeveralIsEnough)
{
  ViewAnswer other("matches", "/line_matches");
  answer_.expect("dock", "goal");
  other.expect("dock", "goal");
  answer_.add(about("dock", "goal", "too small"));
  EXPECT_NE(missingAnswer({ &answer_, &other }), "");
  other.add(about("dock", "goal"));
  EXPECT_EQ(missingAnswer({ &answer_, &other }), "");
}

TEST_F(ViewAnswerTest, TellsInOneLineWhateverOthersSend)
{
  answer_.expect("dock", "");
  EXPECT_FALSE(answer_.add(about("a\nb", "")));
  EXPECT_EQ(answer_.missing(), "matches on '/point_matches' are of view 'a?b', not of 'dock'");
  EXPECT_FALSE(answer_.add(about("dock", "", "too\n  dark")));
  EXPECT_EQ(answer_.missing(), "matches on '/point_matches': too dark");
}

}  // namespace
}  // namespace view_servo
