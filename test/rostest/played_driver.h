// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"

#include "view_servo/HomeToViewAction.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/driver_params.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
using Clock = std::chrono::steady_clock;

constexpr double INPUT_TIMEOUT = 0.05 * SLOWDOWN;  // the robot stands after so long without input [s]
constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;    // of wall time, as the tests of nodes demand [s]
constexpr double EVER = 1e6;                       // patience that never ends [s]

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

inline Stage& stage()
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

inline std::vector<Parameter> parameters(PlayedParams& params)
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
      const double age = secondsSince(stage().last_input);
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

}  // namespace test
}  // namespace view_servo
