// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Any sequence of goals, cancellations, switches and failing inputs against a small model of a driver's states.
#include "driver_states_model.h"
#include "node_test.h"
#include "played_driver.h"

#include <rapidcheck.h>
#include <rapidcheck/state.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
constexpr int BURST = 20;  // zeros in a row after which nothing is sent, as StopBurst has it

/** Does something to the node, and waits until it has come to what the model says. */
class Step : public rc::state::Command<Model, Robot>
{
public:
  void run(const Model& before, Robot& robot) const override
  {
    const Model after = nextState(before);
    robot.allow(before.drives() || after.drives() || drivesMeanwhile(before));
    act(before, robot);
    robot.expect(after);
  }

protected:
  /** Whether a goal may drive that comes and goes within this step. */
  virtual bool drivesMeanwhile(const Model& /*before*/) const
  {
    return false;
  }
  virtual void act(const Model& before, Robot& robot) const = 0;
};

/** The goal that was there ends when another one comes. */
void expectReplacement(const Model& before, const Robot& robot)
{
  if (before.goal != Model::NONE)
  {
    robot.expectEndOfTheOneBefore("another goal has come");
  }
}

#define SHOW(words)                              \
  void show(std::ostream& stream) const override \
  {                                              \
    stream << (words);                           \
  }

struct Enable : Step
{
  SHOW("enable")
  void apply(Model& model) const override
  {
    model.enabled = true;
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.enable(true);
  }
};

struct Disable : Step
{
  SHOW("disable")
  void apply(Model& model) const override
  {
    model.enabled = false;
    model.goal = Model::NONE;
  }
  void act(const Model& before, Robot& robot) const override
  {
    robot.enable(false);
    if (before.goal != Model::NONE)
    {
      robot.expectEnd("disabled");
    }
  }
};

struct SendGoal : Step
{
  SHOW("send a goal")
  void apply(Model& model) const override
  {
    model.sendGoal();
  }
  void act(const Model& before, Robot& robot) const override
  {
    robot.send("goal");
    expectReplacement(before, robot);
    if (!before.enabled)
    {
      robot.expectEnd("disabled: call ~enable first");
    }
  }
};

struct SendTwoGoals : Step
{
  SHOW("send two goals at once")
  void apply(Model& model) const override
  {
    model.sendGoal();
  }
  bool drivesMeanwhile(const Model& before) const override
  {
    return before.enabled;
  }
  void act(const Model& before, Robot& robot) const override
  {
    robot.send("goal");
    expectReplacement(before, robot);
    robot.send("goal");
    robot.expectEndOfTheOneBefore(before.enabled ? "another goal has come" : "");
    if (!before.enabled)
    {
      robot.expectEnd("disabled: call ~enable first");
    }
  }
};

/** Goals that end by themselves. */
struct SendGoalThatFails : Step
{
  explicit SendGoalThatFails(const Model& /*model*/)
    : view(*rc::gen::element<std::string>("unknown", "wordless", "breaks", "late"))
  {
  }
  SHOW("send a goal that fails: " + view)
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(view != "breaks" || (model.peer && model.listener));
  }
  void apply(Model& model) const override
  {
    model.goal = Model::NONE;
  }
  bool drivesMeanwhile(const Model& before) const override
  {
    return before.enabled;
  }
  void act(const Model& before, Robot& robot) const override
  {
    static const std::map<std::string, std::string> words = { { "unknown", "there is no such view" },
                                                              { "wordless", "an exception without a text" },
                                                              { "breaks", "it cannot begin" },
                                                              { "late", " within 0.03 s: " } };
    robot.send(view, view == "late" ? 0.03 : 0.0);
    expectReplacement(before, robot);
    robot.expectEnd(before.enabled ? words.at(view) : "disabled: call ~enable first");
  }
  std::string view;
};

/** What ends a goal. */
struct EndingStep : Step
{
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.goal != Model::NONE);
  }
  void apply(Model& model) const override
  {
    model.goal = Model::NONE;
  }
};

struct Cancel : EndingStep
{
  SHOW("cancel")
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.cancel();
    robot.expectEnd("the goal was cancelled");
  }
};

struct CancelNothing : Step
{
  SHOW("cancel a goal that has ended")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.goal == Model::NONE);
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.cancel();
  }
};

/** The driver says that its goal is over. */
struct Finish : EndingStep
{
  explicit Finish(const Model& /*model*/) : arrives(*rc::gen::arbitrary<bool>()), speaks(*rc::gen::arbitrary<bool>())
  {
  }
  SHOW(std::string(arrives ? "arrive" : "give up") + (speaks ? "" : " without a word"))
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.goal == Model::RUNNING);
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    const std::string words = arrives ? "at the view" : "the view is gone";
    robot.locked([&] { stage().progress = { arrives ? Progress::ARRIVED : Progress::FAILED, speaks ? words : "" }; });
    robot.expectEnd(speaks ? words : "nothing is known yet", arrives);
  }
  bool arrives;
  bool speaks;
};

struct Break : EndingStep
{
  SHOW("the driver throws")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.drives());
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.locked([] { stage().throws = true; });
    robot.expectEnd("a cycle of control failed: the driver is broken");
    robot.locked([] { stage().throws = false; });
  }
};

struct InputStaysAway : EndingStep
{
  SHOW("the input stays away for longer than the goal's patience")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.goal == Model::RUNNING && !model.input);
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    stage().patience = 0.0;
    robot.expectEnd("no input for ");
    stage().patience = EVER;
  }
};

/** Turns one of the model's switches, and the same on the stage. */
template <bool Model::*SWITCH, bool Stage::*PART, bool ON>
struct Turn : Step
{
  SHOW(std::string(SWITCH == &Model::input  ? "input"
                   : SWITCH == &Model::peer ? "peer"
                                            : "listener") +
       (ON ? " comes back" : " is lost"))
  void checkPreconditions(const Model& model) const override
  {
    const bool on = model.*SWITCH;
    RC_PRE(on != ON);
  }
  void apply(Model& model) const override
  {
    model.*SWITCH = ON;
    if (endsGoal(model))
    {
      model.goal = Model::NONE;
    }
    model.beginIfReady();
  }
  void act(const Model& before, Robot& robot) const override
  {
    robot.locked([] { stage().*PART = ON; });
    if (endsGoal(before))
    {
      robot.expectEnd("nobody listens any more");
    }
  }
  static bool endsGoal(const Model& model)
  {
    return SWITCH == &Model::listener && !ON && model.goal == Model::RUNNING;
  }
};
using LoseInput = Turn<&Model::input, &Stage::input_comes, false>;
using ReturnInput = Turn<&Model::input, &Stage::input_comes, true>;
using LosePeer = Turn<&Model::peer, &Stage::has_peer, false>;
using ReturnPeer = Turn<&Model::peer, &Stage::has_peer, true>;
using LoseListener = Turn<&Model::listener, &Stage::has_listener, false>;
using ReturnListener = Turn<&Model::listener, &Stage::has_listener, true>;

struct LoseView : Step
{
  SHOW("lose the view")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.drives());
  }
  void apply(Model& model) const override
  {
    model.lost = true;
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.locked([] { stage().progress = { Progress::LOST, "hidden" }; });
  }
};

struct FindView : Step
{
  SHOW("find the view")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.goal == Model::RUNNING && model.lost);
  }
  void apply(Model& model) const override
  {
    model.lost = false;
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.locked([] { stage().progress = { Progress::DRIVING, "drives" }; });
  }
};

/** Somebody else stops the robot; while it drives, so that it shows when the message has come. */
struct Hold : Step
{
  SHOW("hold")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.drives());
  }
  void apply(Model& model) const override
  {
    model.held = true;
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.hold(true);
  }
};

struct Release : Step
{
  SHOW("release")
  void checkPreconditions(const Model& model) const override
  {
    RC_PRE(model.held);
  }
  void apply(Model& model) const override
  {
    model.held = false;
  }
  void act(const Model& /*before*/, Robot& robot) const override
  {
    robot.hold(false);
  }
};

/** Time passes. Without a goal, zeros follow each other for a while, and then nothing is sent. */
struct Wait : Step
{
  explicit Wait(const Model& /*model*/) : time(*rc::gen::inRange(0, 100))
  {
  }
  SHOW("wait for " + std::to_string(time) + " ms")
  void act(const Model& before, Robot& robot) const override
  {
    const Clock::time_point end = Clock::now() + std::chrono::milliseconds(time);
    RC_ASSERT(waitUntil([&] { return Clock::now() >= end; }));
    if (before.goal == Model::NONE && time > 90)
    {
      const auto zeros = [&] {
        return robot.locked([] { return stage().zeros; });
      };
      const bool ever = zeros() > 0;
      RC_ASSERT(!ever || Robot::soon([&] { return zeros() >= BURST; }));
    }
  }
  int time;
};

TEST(DriverStates, KeepTheRuleInAnySequence)
{
  Robot robot;
  ASSERT_TRUE(robot.waitForNode());
  int steps = 0;
  const bool holds = rc::check("no motion unless enabled, with a goal and fresh inputs; each end has a reason", [&] {
    robot.reset();
    rc::state::check(
        Model(), robot,
        [&, commands = rc::state::gen::execOneOfWithArgs<
                Enable, Enable, Enable, Disable, SendGoal, SendGoal, SendGoal, SendTwoGoals, SendGoalThatFails, Cancel,
                CancelNothing, Finish, Break, LoseInput, ReturnInput, ReturnInput, InputStaysAway, LosePeer, ReturnPeer,
                ReturnPeer, LoseListener, ReturnListener, ReturnListener, LoseView, FindView, FindView, Hold, Release,
                Release, Wait>()](const Model& model) {
          ++steps;
          return commands(model);
        });
    robot.expectRule();
  });
  EXPECT_TRUE(holds);
  EXPECT_GT(steps, 200);
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  // Not in place of what somebody asks for: 'RC_PARAMS="max_success=1000" rosrun view_servo driver_states_test'.
  setenv("RC_PARAMS", "seed=23 max_success=30 max_size=60", 0);
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "driver_states_test");
  ros::NodeHandle keeps_ros_running;
  ros::AsyncSpinner spinner(view_servo::CONTROL_NODE_THREADS);
  spinner.start();
  return RUN_ALL_TESTS();
}
