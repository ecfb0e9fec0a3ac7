// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/approach_law.h"

#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double DT = 0.02;              // between two commands, and two readings of odometry [s]
constexpr int IMAGE_EVERY = 5;           // commands
constexpr double MOST_TOLERANCE = 0.01;  // [m]

ApproachParams differential()
{
  ApproachParams params;
  params.base = BaseKind::DIFFERENTIAL;
  return params;
}

/** A base that follows a law, with odometry that is exact. */
class Base
{
public:
  /** @param goal where the law is told that it is, by how long the base has driven [s]. */
  Base(const PlanarPose& start, std::function<PlanarPose(double)> goal, const ApproachParams& params = differential())
    : pose_(start), goal_(std::move(goal)), law_(makeApproachLaw(params, MOST_TOLERANCE)), limiter_(VelocityLimits())
  {
  }

  void setGoal(std::function<PlanarPose(double)> goal)
  {
    goal_ = std::move(goal);
  }

  /** Drives on until the base stands for a second, or for at most `duration` [s]. */
  void drive(double duration)
  {
    int standing = 0;
    for (int i = 0; i * DT < duration && standing * DT < 1.0 && law_->failure().empty(); ++i)
    {
      time_ += DT;
      const bool image = i % IMAGE_EVERY == 0;
      law_->update({ pose_, goal_(time_), image, image, [](const PlanarPose&) {
                      return 1.0;
                    } });
      const BaseVelocity velocity = limiter_.next(along(law_->course(), pose_), DT);
      EXPECT_EQ(velocity.y(), 0.0);
      standing = velocity.isZero() ? standing + 1 : 0;
      reversals_ += velocity.x() * sense_ < 0.0 ? 1 : 0;
      sense_ = velocity.x() == 0.0 ? sense_ : velocity.x();
      pose_ = compose(pose_, { DT * velocity.x(), 0.0, DT * velocity.z() });
    }
  }

  const PlanarPose& pose() const
  {
    return pose_;
  }
  const ApproachLaw& law() const
  {
    return *law_;
  }
  int reversals() const
  {
    return reversals_;
  }
  double time() const
  {
    return time_;
  }

private:
  PlanarPose pose_;
  std::function<PlanarPose(double)> goal_;
  std::unique_ptr<ApproachLaw> law_;
  BaseVelocityLimiter limiter_;
  double sense_ = 0.0;
  int reversals_ = 0;
  double time_ = 0.0;
};

PlanarPose arbitraryPose(int centimetres, int degrees)
{
  return { *rc::gen::inRange(-centimetres, centimetres) / 100.0, *rc::gen::inRange(-centimetres, centimetres) / 100.0,
           *rc::gen::inRange(-degrees, degrees) * DEGREE };
}

RC_GTEST_PROP(DifferentialLaw, BringsTheBaseToTheGoal, ())
{
  const PlanarPose goal = arbitraryPose(300, 180);
  Base base(compose(goal, arbitraryPose(200, 30)), [&](double) { return goal; });
  base.drive(120.0);
  const PlanarPose left = compose(inverse(goal), base.pose());
  RC_ASSERT(base.law().failure().empty());
  RC_ASSERT(std::abs(left.x) <= 0.002);
  RC_ASSERT(left.distance() <= base.law().tolerance());
  RC_ASSERT(std::abs(left.yaw) <= 0.002);
  RC_ASSERT(base.reversals() <= 4);
}

/** What is known of the goal is 0.3 m wrong at first, and becomes better while the base drives. */
RC_GTEST_PROP(DifferentialLaw, FollowsWhatIsLearntOfTheGoal, ())
{
  const PlanarPose start = arbitraryPose(200, 20);
  const double direction = *rc::gen::inRange(0, 360) * DEGREE;
  const auto goal = [&](double time) {
    const double error = 0.3 * std::exp(-time / 5.0);
    return PlanarPose{ error * std::cos(direction), error * std::sin(direction), 0.2 * error };
  };
  Base base(start, goal);
  base.drive(120.0);
  RC_ASSERT(base.law().failure().empty());
  const PlanarPose left = compose(inverse(goal(base.time())), base.pose());
  RC_ASSERT(left.distance() <= base.law().tolerance());
  RC_ASSERT(std::abs(left.yaw) <= 0.002);
}

/** Two places explain what is seen, and it is now the one, now the other, until the base has driven. */
TEST(DifferentialLaw, DrivesThoughTheGoalJumpsToAndFro)
{
  int calls = 0;
  const Base* driven = nullptr;
  const PlanarPose start{ 0.2, 0.25, 0.38 };
  Base base(start, [&](double) {
    const bool drove = driven != nullptr && compose(inverse(start), driven->pose()).distance() > 0.15;
    return !drove && ++calls / 20 % 2 == 0 ? PlanarPose{ 0.0, 0.11, 0.0 } : PlanarPose();
  });
  driven = &base;
  base.drive(120.0);
  EXPECT_LT(base.pose().distance(), 0.004);
  EXPECT_LT(std::abs(base.pose().yaw), 0.002);
}

TEST(DifferentialLaw, NeedsNoManoeuvreOnTheAxis)
{
  Base base({ -1.0, 0.0, 0.0 }, [](double) { return PlanarPose(); });
  base.drive(30.0);
  EXPECT_LT(base.pose().distance(), 0.004);
  EXPECT_EQ(base.reversals(), 0);
  EXPECT_LT(base.time(), 12.0);
}

/** What becomes of a base for which, each time that it has come to the goal, that is farther to the left [m]. */
std::unique_ptr<Base> neverThere(double farther)
{
  auto base = std::make_unique<Base>(PlanarPose{ -0.5, 0.0, 0.0 }, [](double) { return PlanarPose(); });
  Base* const driven = base.get();
  base->setGoal([driven, farther, goal = PlanarPose()](double) mutable {
    if (std::abs(compose(inverse(goal), driven->pose()).x) < 0.002)
    {
      goal.y = driven->pose().y + farther;
    }
    return goal;
  });
  base->drive(600.0);
  return base;
}

TEST(DifferentialLaw, AcceptsMoreWhereCorrectionsDoNotHelp)
{
  const std::unique_ptr<Base> base = neverThere(0.006);
  EXPECT_EQ(base->law().failure(), "");
  EXPECT_GE(base->law().tolerance(), 0.006);
  EXPECT_LE(base->law().tolerance(), MOST_TOLERANCE);
}

TEST(DifferentialLaw, FailsWhereCorrectionsNeverHelp)
{
  const std::unique_ptr<Base> base = neverThere(0.02);
  EXPECT_NE(base->law().failure().find("corrections do not bring the base nearer"), std::string::npos)
      << base->law().failure();
}

TEST(DifferentialLaw, SaysWhatItDoes)
{
  const auto law = makeApproachLaw(differential(), MOST_TOLERANCE);
  law->update({ { -1.0, 0.5, 0.0 }, PlanarPose(), true, true, [](const PlanarPose&) {
                 return 1.0;
               } });
  EXPECT_NE(law->text().find("degrees to the right (1 of "), std::string::npos) << law->text();
}

TEST(DifferentialLaw, SaysThatThereIsNoWay)
{
  const auto law = makeApproachLaw(differential(), MOST_TOLERANCE);
  law->update({ { -1.0, 0.5, 0.0 }, PlanarPose(), true, true, [](const PlanarPose&) {
                 return 0.0;
               } });
  EXPECT_EQ(law->text(), "no way to the view keeps enough of it in sight");
  EXPECT_EQ(law->course().kind, Course::STAND);
}

}  // namespace
}  // namespace view_servo
