// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/joint_guard.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
class JointGuardTest : public ::testing::Test
{
protected:
  void at(double time, double position, double velocity)
  {
    guard_.add(time, { "free", "elbow" }, { 9.0, position }, { 0.0, velocity });
  }

  JointGuard guard_{ { { "elbow", { -1.0, 2.0 } }, { "never_seen", { 0.0, 1.0 } } }, 0.02, 1.0 };
};

TEST_F(JointGuardTest, SaysNothingWithinTheLimits)
{
  at(0.0, 1.97, 1.0);
  EXPECT_EQ(guard_.problem(0.0), "");
  at(0.0, -0.97, -1.0);
  EXPECT_EQ(guard_.problem(0.0), "");
}

TEST_F(JointGuardTest, NamesAJointThatMovesOnAtItsLimit)
{
  at(0.0, 1.99, 0.1);
  EXPECT_NE(guard_.problem(0.0).find("'elbow' is at 1.990, its limit is 2.000"), std::string::npos);
  at(0.0, -0.99, -0.1);
  EXPECT_NE(guard_.problem(0.0).find("-1.000"), std::string::npos);
}

TEST_F(JointGuardTest, LetsAJointComeAway)
{
  at(0.0, 1.99, 0.0);
  EXPECT_EQ(guard_.problem(0.0), "");
  at(0.1, 1.99, -0.1);
  EXPECT_EQ(guard_.problem(0.1), "");
  at(0.3, 1.99, 0.0);  // begins to stand anew
  EXPECT_EQ(guard_.problem(0.3), "");
  EXPECT_NE(guard_.problem(0.5), "");
  guard_.clearStuck();
  EXPECT_EQ(guard_.problem(0.6), "");
}

TEST_F(JointGuardTest, TakesVelocitiesFromPositions)
{
  guard_.add(0.0, { "elbow" }, { 1.985 }, {});
  guard_.add(0.1, { "elbow" }, { 1.990 }, {});
  EXPECT_NE(guard_.problem(0.1), "");
  guard_.add(0.2, { "elbow" }, { 1.985 }, {});
  EXPECT_EQ(guard_.problem(0.2), "");
}

TEST_F(JointGuardTest, IsNotConfusedByNonsense)
{
  EXPECT_EQ(guard_.add(0.0, { "elbow", "free" }, {}, {}), "");
  EXPECT_NE(guard_.add(0.0, { "elbow" }, { std::numeric_limits<double>::quiet_NaN() }, {}).find("'elbow'"),
            std::string::npos);
  EXPECT_EQ(guard_.problem(1.0), "");
}

TEST_F(JointGuardTest, ComputesAVelocityThatIsNotKnown)
{
  constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  guard_.add(0.1, { "elbow" }, { 1.995 }, { UNKNOWN });
  guard_.add(0.2, { "elbow" }, { 1.985 }, { UNKNOWN });
  EXPECT_EQ(guard_.problem(0.2), "") << "it comes away from the limit";
}

TEST_F(JointGuardTest, DoesNotBelieveAPositionFarBeyondTheLimits)
{
  EXPECT_EQ(guard_.add(0.0, { "elbow" }, { 2.2 }, { 0.0 }), "");  // an encoder may be off by that
  for (const double nowhere : { 2.4, 99.0, -1.4, -1e300, std::numeric_limits<double>::infinity() })
  {
    EXPECT_NE(guard_.add(0.1, { "elbow" }, { nowhere }, { 1.0 }).find("'elbow' is said to be at"), std::string::npos);
  }
  EXPECT_NE(guard_.add(0.1, { "elbow", "free" }, { 99.0, 9.0 }, {}), "");
  EXPECT_EQ(guard_.add(0.1, { "free" }, { 99.0 }, {}), "");
}

TEST_F(JointGuardTest, ForgetsWhatIsOld)
{
  at(0.0, 1.99, 0.1);
  EXPECT_NE(guard_.problem(0.9), "");
  EXPECT_EQ(guard_.problem(1.1), "");
}

/** A gripper rests at a limit for as long as it holds something. */
TEST(JointGuard, LetsAGripperRestAtItsLimit)
{
  const std::vector<std::string> names{ "elbow", "finger" };
  for (const std::set<std::string>& carrying : { std::set<std::string>{ "elbow" }, std::set<std::string>{} })
  {
    JointGuard guard({ { "elbow", { -1.0, 2.0 } }, { "finger", { 0.0, 0.04 } } }, 0.02, 1.0);
    guard.begin(carrying);
    guard.add(0.0, names, { 1.0, 0.0 }, {});
    guard.add(0.1, names, { 1.1, 0.0 }, {});
    EXPECT_EQ(guard.problem(0.1), "");
    EXPECT_EQ(guard.problem(0.5), "") << "the finger stands at its limit";
    guard.add(0.6, names, { 1.99, 0.0 }, { 0.1, 0.0 });
    EXPECT_NE(guard.problem(0.6).find("'elbow' is at 1.990"), std::string::npos);
    guard.begin(carrying);
    EXPECT_EQ(guard.problem(0.7), "") << "what was heard before the goal does not count";
  }
}

/** Which joint moves the camera may not be known: then one at its limit counts where the arm does not move at all. */
TEST(JointGuard, NamesTheJointThatBlocksTheArmFromTheStart)
{
  JointGuard guard({ { "elbow", { -1.0, 2.0 } }, { "wrist", { -3.0, 3.0 } } }, 0.02, 1.0);
  guard.begin({});
  std::string problem;
  double time = 0.0;
  for (; problem.empty() && time < 3.0; time += 0.1)
  {
    guard.add(time, { "elbow", "wrist" }, { 1.99, 0.5 }, { 0.0, 0.0 });
    problem = guard.problem(time);
  }
  EXPECT_NE(problem.find("'elbow'"), std::string::npos);
  EXPECT_NEAR(time, 1.3, 0.25);
  guard.begin({});
  for (time = 0.0; time < 3.0; time += 0.1)
  {
    guard.add(time, { "elbow", "wrist" }, { 1.99, 0.5 + 0.1 * time }, { 0.0, 0.1 });
    EXPECT_EQ(guard.problem(time), "") << "the arm moves";
  }
}

TEST(JointGuard, KnowsWhichMessagesTellOfTheArm)
{
  JointGuard guard({ { "elbow", { -1.0, 2.0 } }, { "finger", { 0.0, 0.04 } } }, 0.02, 1.0);
  EXPECT_TRUE(guard.tells({ "finger" }, { 0.0 }));
  guard.begin({ "elbow" });
  EXPECT_FALSE(guard.tells({ "finger" }, { 0.0 }));
  EXPECT_TRUE(guard.tells({ "finger", "elbow" }, { 0.0, 0.0 }));
  EXPECT_FALSE(guard.tells({ "finger", "elbow" }, {})) << "positions are missing";
  guard.add(0.0, { "elbow", "finger" }, { 0.0, 0.0 }, {});
  EXPECT_EQ(guard.silent(0.9), "");
  EXPECT_EQ(guard.silent(1.1), "elbow");
  guard.begin({ "elbow" });
  EXPECT_EQ(guard.silent(9.0), "") << "it has not been heard of since";
}

}  // namespace
}  // namespace view_servo
