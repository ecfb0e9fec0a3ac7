// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Any sequence of goals, cancellations, switches and failing inputs against a small model of a driver's states.
#include "node_test.h"

#include "view_servo/HomeToViewAction.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/driver_params.h"

#include <rapidcheck.h>
#include <rapidcheck/state.h>
#include <std_msgs/Bool.h>
#include <std_srvs/SetBool.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
using Clock = std::chrono::steady_clock;

constexpr double INPUT_TIMEOUT = 0.05 * SLOWDOWN;  // the robot stands after so long without input [s]
constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;    // of wall time, as the tests of nodes demand [s]
constexpr double EVER = 1e6;                       // patience that never ends [s]
constexpr int BURST = 20;                          // zeros in a row after which nothing is sent, as StopBurst has it

/**
 * What the driver's functions are told to do, and what they see. All but the atomic members are guarded by the node's
 * mutex, with which DriverNode calls a driver.
 */
struct Stage
{
  DriverContext* context = nullptr;
  DriverInput* input = nullptr;

  // Told.
  std::atomic<double> patience{ EVER };  // [s]
  bool input_comes = true;
  bool has_peer = true;      // what a goal waits for before it begins
  bool has_listener = true;  // to the commands
  bool throws = false;       // when it is asked where to go
  Progress progress;         // of a goal that has begun

  // Seen.
  bool begun = false;            // between begin() and end()
  Clock::time_point last_input;  // when input came
  BaseVelocity last_velocity = BaseVelocity::Zero();
  int zeros = 0;           // sent since the last motion
  std::uint8_t state = 0;  // of ServoStatus, that was filled last
  std::string reason;      // the same

  // The rule.
  bool enabled = false;   // false once ~enable has answered so
  bool may_move = false;  // by the model
  std::vector<std::string> broken;

  void require(bool holds, const std::string& rule)
  {
    if (!holds)
    {
      broken.push_back(rule);
    }
  }
};

Stage& stage()
{
  static Stage the_stage;
  return the_stage;
}

struct PlayedParams
{
  DriverParams node;
  VelocityLimits limits;

  static double patience()
  {
    return stage().patience;
  }
  static std::vector<std::string> validate()
  {
    return {};
  }
};

std::vector<Parameter> parameters(PlayedParams& params)
{
  return joined({ parameters(params.node), parameters(params.limits) });
}

/** A driver that does what stage() says and checks the rule with each command. */
class PlayedDriver
{
public:
  using Action = HomeToViewAction;
  using Velocity = BaseVelocity;
  using Limiter = BaseVelocityLimiter;
  using Task = std::string;
  using Params = PlayedParams;
  static constexpr const char* ACTION = "home";

  PlayedDriver(DriverContext& context, const Params& /*params*/)
  {
    stage().context = &context;
    stage().input = &context.addInput("input", "'played'", INPUT_TIMEOUT);
  }

  static std::unique_ptr<Task> prepare(const HomeToViewGoal& goal)
  {
    if (goal.view == "unknown")
    {
      throw std::invalid_argument("there is no such view");
    }
    if (goal.view == "wordless")
    {
      throw std::runtime_error("");
    }
    stage().context->waitFor(
        [] { return stage().context->locked([] { return std::string(stage().has_peer ? "" : "no peer answers"); }); });
    return std::make_unique<Task>(goal.view);
  }

  static void begin(std::unique_ptr<Task> task)
  {
    stage().require(!stage().begun, "a goal begins after the one before has ended");
    stage().begun = true;
    stage().progress = { Progress::ACQUIRING, "waits for input" };
    if (*task == "breaks")
    {
      throw std::runtime_error("it cannot begin");
    }
  }
  static void end()
  {
    stage().begun = false;
  }
  static Progress progress()
  {
    return stage().progress;
  }
  static Velocity wanted(double /*time*/)
  {
    if (stage().throws)
    {
      throw std::runtime_error("the driver is broken");
    }
    return { 0.1, 0.0, 0.05 };
  }
  static void sent(double /*time*/, const Velocity& /*velocity*/)
  {
  }
  static void onMissingInput(double /*time*/, const std::string& what)
  {
    stage().require(!what.empty(), "missing input has a name");
  }
  static bool hasListener()
  {
    return stage().has_listener;
  }

  /** The rule: no motion unless enabled, with a goal that has begun, and with fresh inputs. */
  static void publish(const Velocity& velocity)
  {
    stage().last_velocity = velocity;
    stage().zeros = velocity.isZero() ? stage().zeros + 1 : 0;
    if (!velocity.isZero())
    {
      const double age = std::chrono::duration<double>(Clock::now() - stage().last_input).count();
      stage().require(stage().enabled, "no motion unless enabled");
      stage().require(stage().begun, "no motion without a goal that has begun");
      stage().require(age < STOPS_WITHIN, "no motion without fresh input");
      stage().require(stage().progress.state == Progress::DRIVING, "no motion unless the driver knows where to go");
      stage().require(stage().may_move, "no motion in a state in which the model stands");
    }
  }

  static std::optional<double> takeLatency()
  {
    return 1.0;
  }
  static void fill(const ServoStatus& status)
  {
    stage().state = status.state;
    stage().reason = status.reason;
    stage().require(!status.reason.empty(), "each status has a reason");
    const bool moves = status.state == ServoStatus::SERVOING;
    stage().require(moves || stage().last_velocity.isZero(), "zero is sent before words say that it stands");
  }
  static void fill(const HomeToViewResult& /*result*/)
  {
    stage().require(stage().last_velocity.isZero(), "zero is sent before a goal ends");
  }
  static void fill(const HomeToViewFeedback& /*feedback*/, const ServoStatus& /*status*/)
  {
  }
  static void diagnose(const diagnostic_updater::DiagnosticStatusWrapper& /*status*/)
  {
  }
  static std::string idleView()
  {
    return "";
  }
};

// ------------------------------------------------------------------------------------------------------- the model

struct Model
{
  enum Goal
  {
    NONE,
    PREPARING,
    RUNNING
  };
  Goal goal = NONE;
  bool enabled = false;
  bool input = true;
  bool peer = true;
  bool listener = true;
  bool held = false;
  bool lost = false;      // the view, by the goal that runs
  bool answered = false;  // by the peer, of the goal that is being prepared; what waits after that waits for a listener

  bool drives() const
  {
    return goal == RUNNING && enabled && input && !held && !lost;
  }
  /** What becomes of a goal that waits. */
  void beginIfReady()
  {
    answered = answered || peer;
    if (goal == PREPARING && answered && listener)
    {
      goal = RUNNING;
      lost = false;
    }
  }
  void sendGoal()
  {
    goal = enabled ? PREPARING : NONE;
    answered = false;
    beginIfReady();
  }
};

/** The node, and a client that sends it what people and programs send. */
class Robot
{
public:
  Robot()
  {
    ros::NodeHandle nh;
    goals_ = nh.advertise<HomeToViewActionGoal>("home/goal", 20);
    cancels_ = nh.advertise<actionlib_msgs::GoalID>("home/cancel", 20);
    stop_ = nh.advertise<std_msgs::Bool>("stop", 20);
    results_ = nh.subscribe<HomeToViewActionResult>("home/result", 100, &Robot::takeResult, this);
    feeder_ = std::thread([this] { feed(); });
  }
  ~Robot()
  {
    over_ = true;
    feeder_.join();
  }
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  bool waitForNode() const
  {
    return waitForService(ENABLE) && waitUntil([this] {
             return goals_.getNumSubscribers() > 0 && cancels_.getNumSubscribers() > 0 &&
                    stop_.getNumSubscribers() > 0 && results_.getNumPublishers() > 0;
           });
  }

  /** Waits, but not so long that it takes minutes to find the shortest sequence that fails. */
  static bool soon(const std::function<bool()>& predicate)
  {
    const Clock::time_point deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(5.0 * SLOWDOWN));
    bool holds = false;
    waitUntil([&] {
      holds = predicate();
      return holds || Clock::now() > deadline;
    });
    return holds;
  }

  /** With the node's mutex held. */
  template <typename Body>
  auto locked(const Body& body) const
  {
    return stage().context->locked(body);
  }

  /** As a new model is. */
  void reset()
  {
    allow(true);  // the goal of a sequence that failed
    stage().patience = EVER;
    hold(false);
    cancel();
    enable(false);
    RC_ASSERT(soon([this] { return openGoals() == 0; }));
    locked([] {
      stage().has_peer = stage().has_listener = stage().input_comes = true;
      stage().throws = false;
      stage().broken.clear();
    });
    allow(false);
  }

  void allow(bool motion) const
  {
    locked([&] { stage().may_move = motion; });
  }

  void enable(bool on) const
  {
    if (on)
    {
      locked([] { stage().enabled = true; });
    }
    std_srvs::SetBool::Request request;
    request.data = on ? 1 : 0;
    std_srvs::SetBool::Response response;
    RC_ASSERT(callService(ENABLE, request, response));
    if (!on)
    {
      locked([] { stage().enabled = false; });  // a cycle that had begun before is over now
    }
  }

  void send(const std::string& view, double timeout = 0.0)
  {
    HomeToViewActionGoal message;
    message.header.stamp = ros::Time::now();
    message.goal_id.stamp = message.header.stamp;
    message.goal_id.id = "goal " + std::to_string(++count_);
    message.goal.view = view;
    message.goal.timeout = timeout;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      open_.insert(message.goal_id.id);
    }
    before_ = goal_;
    goal_ = message.goal_id.id;
    goals_.publish(message);
  }
  void cancel() const
  {
    actionlib_msgs::GoalID id;
    id.id = goal_;
    cancels_.publish(id);
  }
  void hold(bool on) const
  {
    std_msgs::Bool message;
    message.data = on ? 1 : 0;
    stop_.publish(message);
  }

  /** The goal sent last, or the one before it, must end for a reason with these words. */
  void expectEnd(const std::string& words, bool success = false) const
  {
    expectEndOf(goal_, words, success);
  }
  void expectEndOfTheOneBefore(const std::string& words) const
  {
    expectEndOf(before_, words, false);
  }

  /** The node must come to what the model says, and must have kept the rule until then. */
  void expect(const Model& model) const
  {
    const std::size_t open = model.goal == Model::NONE ? 0 : 1;
    const bool reached = soon([&] {
      return openGoals() == open && locked([&] {
               const bool moves = !stage().last_velocity.isZero();
               return moves == model.drives() && stage().begun == (model.goal == Model::RUNNING) &&
                      (open == 0 || saysSo(model));
             });
    });
    if (!reached)
    {
      RC_FAIL(std::to_string(openGoals()) + " goals, not " + std::to_string(open) + ", and the node does not come to " +
              (model.drives() ? "drive" : "stand") + ": " + locked([] { return stage().reason; }));
    }
    allow(model.drives());
    expectRule();
  }

  void expectRule() const
  {
    const std::vector<std::string> broken = locked([] { return stage().broken; });
    if (!broken.empty())
    {
      RC_FAIL("broken rule: " + broken.front());
    }
  }

private:
  static constexpr const char* ENABLE = "driver_states_test/enable";

  /** Whether the last status of a goal says what the model is in. */
  static bool saysSo(const Model& model)
  {
    if (model.goal == Model::PREPARING)
    {
      const char* words = model.answered ? "nobody listens on " : "no peer answers";
      return stage().state == (model.held ? ServoStatus::LOST : ServoStatus::ACQUIRING) &&
             stage().reason.find(words) != std::string::npos;
    }
    return stage().state == (model.drives() ? ServoStatus::SERVOING : ServoStatus::LOST);
  }

  std::size_t openGoals() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return open_.size();
  }

  void expectEndOf(const std::string& id, const std::string& words, bool success) const
  {
    const auto ended = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      return ends_.count(id) == 1;
    };
    if (!soon(ended))
    {
      RC_FAIL("a goal does not end, although " + words);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    const HomeToViewActionResult& end = ends_.at(id);
    RC_ASSERT(!end.result.message.empty());
    RC_ASSERT(end.result.message == end.status.text);
    RC_ASSERT((end.result.success != 0) == success);
    if (end.result.message.find(words) == std::string::npos)
    {
      RC_FAIL("a goal ends with '" + end.result.message + "', not '" + words + "'");
    }
  }

  void takeResult(const HomeToViewActionResult::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ends_[message->status.goal_id.id] = *message;
    open_.erase(message->status.goal_id.id);
  }

  /** Input comes, and after the first one a goal that has begun knows where to go. */
  void feed() const
  {
    const ros::WallDuration period(0.004);
    while (!over_)
    {
      if (stage().context != nullptr)
      {
        locked([] {
          if (stage().input_comes)
          {
            stage().input->accept();
            stage().last_input = Clock::now();
            if (stage().begun && stage().progress.state == Progress::ACQUIRING)
            {
              stage().progress = { Progress::DRIVING, "drives" };
            }
          }
        });
      }
      period.sleep();
    }
  }

  // Of the node, first, so that it ends last.
  ros::NodeHandle keeps_;
  DriverNode<PlayedDriver> node_{ ros::NodeHandle(), ros::NodeHandle("~") };

  ros::Publisher goals_;
  ros::Publisher cancels_;
  ros::Publisher stop_;
  ros::Subscriber results_;
  int count_ = 0;
  std::string goal_ = "goal 0";  // sent last
  std::string before_;           // sent before it
  mutable std::mutex mutex_;
  std::set<std::string> open_;                          // goals that have not ended
  std::map<std::string, HomeToViewActionResult> ends_;  // of the others
  std::atomic<bool> over_{ false };
  std::thread feeder_;
};

// -------------------------------------------------------------------------------------------------------- commands

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
