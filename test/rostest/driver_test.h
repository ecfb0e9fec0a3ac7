// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "child_process.h"
#include "commands.h"
#include "node_test.h"
#include "support/temporary_directory.h"

#include "view_servo/ServoStatus.h"
#include "view_servo/WantedView.h"
#include "view_servo/parameters/seconds_since.h"

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace test
{
constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;  // of wall time, whatever fails [s]
constexpr double ENDS_WITHIN = 1.0 * SLOWDOWN;   // after SIGINT [s]

/** Stamps that no clock has: unset, the largest, next to it. */
inline std::vector<ros::Time> extremeStamps()
{
  const std::uint32_t largest = std::numeric_limits<std::uint32_t>::max();
  return { ros::Time(0, 0), ros::Time(0, 1), ros::Time(largest, 999999999), ros::Time(largest, 0), ros::Time(1, 0) };
}

/** Numbers that a field may have by mistake. */
inline std::vector<double> extremeNumbers()
{
  return { std::numeric_limits<double>::quiet_NaN(),
           std::numeric_limits<double>::infinity(),
           -std::numeric_limits<double>::infinity(),
           std::numeric_limits<double>::max(),
           1e-300,
           1e-7,
           0.0,
           -1.0 };
}

/**
 * What fake robots share: a thread that publishes at a rate, and the view that the driver wants. Each flag lets
 * something fail.
 */
class FakeRobot
{
public:
  FakeRobot(const std::string& ns, const std::string& driver) : nh_(ns)
  {
    wanted_subscriber_ = nh_.subscribe<WantedView>(driver + "/wanted_view", 5, &FakeRobot::takeWantedView, this);
  }
  virtual ~FakeRobot() = default;
  FakeRobot(const FakeRobot&) = delete;
  FakeRobot& operator=(const FakeRobot&) = delete;

  WantedView wantedView() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return wanted_;
  }

  /** What the driver follows the view by does not come any more, or comes again. */
  virtual void hush(bool silent)
  {
    answers = !silent;
  }

  /** What the robot is told. By default it stands still, whatever that is. */
  template <typename Message>
  void obey(const CommandsOf<Message>& /*commands*/)
  {
  }

  std::atomic<bool> answers{ true };  // what matches or follows the view publishes
  std::atomic<bool> camera{ true };   // publishes
  std::atomic<bool> calibrated{ true };
  std::atomic<double> focal_length{ 500.0 };
  std::atomic<bool> other_view{ false };  // is what is matched or followed
  std::atomic<bool> refuses{ false };     // the view, for good
  std::atomic<bool> frozen{ false };      // stamps stand still
  std::atomic<bool> unstamped{ false };   // stamps are all zero
  std::atomic<double> delay{ 0.0 };       // of all stamps [s]

protected:
  ros::Time stamp()
  {
    if (unstamped)
    {
      return {};
    }
    if (!frozen)
    {
      stamp_ = ros::Time::now() - ros::Duration(delay);
    }
    return stamp_;
  }

  void start(double rate, std::function<void(int cycle)> publish)
  {
    thread_ = std::thread([this, rate, publish = std::move(publish)] {
      ros::WallRate wall_rate(rate);
      for (int cycle = 0; running_ && ros::ok(); ++cycle)
      {
        publish(cycle);
        wall_rate.sleep();
      }
    });
  }
  void stop()
  {
    running_ = false;
    if (thread_.joinable())
    {
      thread_.join();
    }
  }

  /** Fills the fields that say which view a message is about. @return whether one is wanted. */
  template <typename Message>
  bool fill(Message& message) const
  {
    const WantedView wanted = wantedView();
    message.view = other_view ? "another" : wanted.view;
    message.goal = other_view ? "" : wanted.goal;
    message.refused = refuses ? 1 : 0;
    message.reason = refuses ? "it is too dark" : message.reason;
    return !wanted.view.empty();
  }

  ros::NodeHandle nh_;

private:
  void takeWantedView(const WantedView::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = *message;
  }

  mutable std::mutex mutex_;
  WantedView wanted_;
  ros::Subscriber wanted_subscriber_;
  ros::Time stamp_;
  std::atomic<bool> running_{ true };
  std::thread thread_;
};

/** Enables a driver and sends it a goal, as soon as it takes one. @param enable_service of the driver. */
template <typename Action>
void enableAndSend(actionlib::SimpleActionClient<Action>& client, const std::string& enable_service,
                   const std::string& view, double timeout)
{
  ASSERT_TRUE(waitForService(enable_service));
  ASSERT_TRUE(waitUntil([&] { return client.isServerConnected(); }));
  std_srvs::SetBool::Request enable;
  enable.data = 1;
  EXPECT_TRUE(answerOf<std_srvs::SetBool>(enable_service, enable).success);
  typename Action::_action_goal_type::_goal_type goal;
  goal.view = view;
  goal.timeout = timeout;
  client.sendGoal(goal);
}

/**
 * A driver with a robot that the test plays. `Robot` is a FakeRobot with
 *  - `Action`, `Command`, and the names DRIVER (node), ACTION, SILENT (words about a peer that does not answer);
 *  - a constructor (ns); the NAMESPACE of the driver that is running;
 *  - `static std::vector<std::string> program()`: how another one is started;
 *  - `void publishExtremes()`: messages on every input, with everything in them that can be wrong.
 */
template <typename Robot>
class DriverTest : public ::testing::Test
{
protected:
  using Clock = std::chrono::steady_clock;
  using Action = typename Robot::Action;
  using Goal = typename Action::_action_goal_type::_goal_type;
  using Result = typename Action::_action_result_type::_result_type;
  using Client = actionlib::SimpleActionClient<Action>;
  using Commands = CommandsOf<typename Robot::Command>;
  using GoalState = actionlib::SimpleClientGoalState;

  DriverTest() : DriverTest(Robot::NAMESPACE, "cmd_vel")
  {
  }
  DriverTest(const std::string& ns, const std::string& command_topic)
    : ns_(ns),
      commands_(ns + "/" + command_topic),
      robot_(ns),
      status_(ns + "/status"),
      client_(ns + "/" + Robot::ACTION, false)
  {
    robot_.obey(commands_);
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitForService(enableService()));
    ASSERT_TRUE(waitUntil([this] { return client_.isServerConnected(); }));
    enable(true);
  }
  void TearDown() override
  {
    client_.cancelAllGoals();
    enable(false);
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  std::string enableService() const
  {
    return ns_ + "/" + Robot::DRIVER + "/enable";
  }

  void enable(bool on) const
  {
    std_srvs::SetBool::Request request;
    request.data = on ? 1 : 0;
    const std_srvs::SetBool::Response response = answerOf<std_srvs::SetBool>(enableService(), request);
    EXPECT_TRUE(response.success) << response.message;
  }

  void send(const std::string& view, double timeout = 60.0)
  {
    Goal goal;
    goal.view = view;
    goal.timeout = timeout;
    client_.sendGoal(goal);
  }

  void drive()
  {
    send("goal");
    ASSERT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  }

  /**
   * The same after extreme messages: the last of them may come only when the goal has begun, and end it by its reason.
   */
  void driveAfterExtremes()
  {
    send("goal");
    ASSERT_TRUE(waitUntil([this] { return commands_.moving() || client_.getState().isDone(); })) << reason();
    if (!commands_.moving())
    {
      EXPECT_FALSE(client_.getState().getText().empty());
      send("goal");
    }
    ASSERT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  }

  /** Sends a goal whose view nobody matches or follows, and waits until it waits for that. */
  void prepareInVain(double timeout = 60.0)
  {
    robot_.answers = false;
    send("goal", timeout);
    ASSERT_TRUE(waitUntil([this] {
      return client_.getState() == GoalState::ACTIVE && reason().find(Robot::SILENT) != std::string::npos;
    })) << reason();
  }

  std::string reason() const
  {
    const std::optional<ServoStatus> last = status_.last();
    return last ? last->reason : "no status";
  }

  /** After `fault`, the robot must stand in time, with a status that has these words in it. */
  void expectToStop(const std::function<void()>& fault, std::uint8_t state, const std::string& words)
  {
    const Clock::time_point moment = Clock::now();
    fault();
    EXPECT_TRUE(waitUntil([&] {
      const std::optional<ServoStatus> last = status_.last();
      return last && last->state == state && last->reason.find(words) != std::string::npos;
    })) << "it says '"
        << reason() << "', not '" << words << "'";
    EXPECT_TRUE(waitUntil([&] { return !commands_.moving(); }));
    EXPECT_LT(commands_.lastMotionAfter(moment), STOPS_WITHIN);
  }

  void expectToGoOn()
  {
    EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  }

  /** While `flag` is not as it was, the robot must stand, with a status that has these words in it; then it goes on. */
  void expectToStopWhile(std::atomic<bool>& flag, const std::string& words)
  {
    const bool usual = flag;
    expectToStop([&] { flag = !usual; }, ServoStatus::LOST, words);
    flag = usual;
    expectToGoOn();
  }

  /** When stamps fall behind, up to a delay [s], the robot must stand, for a reason with these words. */
  void expectToStopForOldStamps(double most, const std::string& words)
  {
    // Gradually, so that time does not go back.
    const auto delay_more = [&] {
      robot_.delay = std::min(most, robot_.delay + 0.005);
    };
    EXPECT_TRUE(waitUntil([&] { return reason().find(words) != std::string::npos; }, delay_more)) << reason();
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  /** The result of the goal sent last; what is told of it must agree, and the last command must be zero. */
  Result result()
  {
    EXPECT_TRUE(waitUntil([this] { return client_.getState().isDone(); })) << reason();
    const auto found = client_.getResult();
    if (!found)
    {
      ADD_FAILURE() << "a goal has ended without a result";
      return Result();
    }
    EXPECT_FALSE(found->message.empty());
    EXPECT_EQ(client_.getState().getText(), found->message);
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
    return *found;
  }

  /** The goal sent last must fail, for a reason with these words. @return its result. */
  Result expectToFail(const std::string& words)
  {
    Result final = result();
    EXPECT_FALSE(final.success);
    EXPECT_NE(final.message.find(words), std::string::npos) << final.message;
    return final;
  }

  /** After `cause` the goal must end in time, in this state of the action and with these words. */
  void expectToEnd(const std::function<void()>& cause, GoalState::StateEnum state, const std::string& words,
                   double within = STOPS_WITHIN)
  {
    const Clock::time_point moment = Clock::now();
    cause();
    EXPECT_TRUE(waitUntil([this] { return client_.getState().isDone(); })) << reason();
    EXPECT_LT(secondsSince(moment), within);
    expectToFail(words);
    EXPECT_EQ(client_.getState().state_, state);
    EXPECT_LT(commands_.lastMotionAfter(moment), STOPS_WITHIN);
  }

  /** Another driver of the same kind, for ends of its process. */
  struct OtherDriver
  {
    explicit OtherDriver(const std::string& views_dir)
      : commands("ending/cmd_vel"),
        robot("ending"),
        status("ending/status"),
        client(std::string("ending/") + Robot::ACTION, false),
        node(commandOf(views_dir), directory.path() / "output")
    {
      robot.obey(commands);
    }

    static std::vector<std::string> commandOf(const std::string& views_dir)
    {
      std::vector<std::string> words = Robot::program();
      words.insert(words.end(), { "__ns:=ending", "_views_dir:=" + views_dir });
      return words;
    }

    void send(const std::string& view)
    {
      enableAndSend(client, std::string("ending/") + Robot::DRIVER + "/enable", view, Goal().timeout);
    }

    /** The process must end in time, and leave a robot that stands and a goal that has ended. */
    void expectToEnd(const std::function<void()>& cause)
    {
      const Clock::time_point moment = Clock::now();
      cause();
      EXPECT_TRUE(waitUntil([this] { return client.getState().isDone(); })) << node.output();
      EXPECT_LT(secondsSince(moment), ENDS_WITHIN);
      EXPECT_EQ(node.exitStatus(), 0) << node.output();
      EXPECT_LT(secondsSince(moment), 2.0 * SLOWDOWN);
      EXPECT_FALSE(commands.moving());
      EXPECT_LT(commands.lastMotionAfter(moment), STOPS_WITHIN);
      EXPECT_EQ(client.getState().getText(), "the node is shutting down");
      EXPECT_EQ(status.last() ? status.last()->reason : "", "the node is shutting down");
    }

    const TemporaryDirectory directory;
    Commands commands;
    Robot robot;
    Recorder<ServoStatus> status;
    Client client;
    ChildProcess node;
  };

  std::string viewsDirectory() const
  {
    return viewsDir(ns_ + "/" + Robot::DRIVER).string();
  }

  std::string ns_;
  Commands commands_;
  Robot robot_;
  Recorder<ServoStatus> status_;
  Client client_;
};

/** A driver with ~dry_run: its commands go to the topic cmd_vel_dry. */
template <typename Robot>
class DryDriverTest : public DriverTest<Robot>
{
protected:
  DryDriverTest() : DriverTest<Robot>("dry", "cmd_vel_dry")
  {
  }

  CommandsOf<typename Robot::Command> real_commands_{ "dry/cmd_vel" };
};

/**
 * main() of a driver's test. @param make the view that goals name "goal". @param node whose directory of views it goes
 * to.
 */
inline int runDriverTests(int argc, char** argv, const std::string& name, const std::string& node,
                          const std::function<StoredView()>& make)
{
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, name);
  ros::NodeHandle keeps_ros_running;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  saveView(node, make());
  const int result = RUN_ALL_TESTS();
  removeViews(node);
  return result;
}

}  // namespace test
}  // namespace view_servo
