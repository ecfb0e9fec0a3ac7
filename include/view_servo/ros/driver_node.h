// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/goal_rules.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/inbox.h"
#include "view_servo/ros/live_parameters.h"
#include "view_servo/ros/timings.h"

#include <actionlib/server/action_server.h>
#include <diagnostic_msgs/DiagnosticStatus.h>
#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <std_msgs/Bool.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

namespace view_servo
{
/**
 * A node that drives a robot to a stored view. It handles goals, the gate, limits, commands, status and diagnostics;
 * the type `Driver` adds what is particular to a kind of robot. Private parameters that all drivers have: see
 * DriverParams.
 *
 * Publishes `~wanted_view` (view_servo/WantedView, latched), which matchers and trackers follow: nothing that moves a
 * robot waits for the answer of a service. `status` (view_servo/ServoStatus, latched); `/diagnostics`. Services:
 * `~enable` (std_srvs/SetBool). Action: Driver::ACTION. Subscribes `stop` (std_msgs/Bool): after true the robot stands,
 * and after false it goes on, for whatever else watches it.
 *
 * A goal exists from the moment it is accepted. A thread of the node prepares it, and may wait for that. In every cycle
 * of control, before the goal begins and after, judge() decides whether it goes on. However a goal ends, first zero is
 * sent, then the reason is published, and more zeros follow for a while. One mutex guards node and driver (see
 * DriverContext). Callbacks of actionlib only fill inboxes.
 *
 * `Driver` has
 *  - `Action`, `Velocity`, `Limiter` (of Velocity), `Task` (a goal that is ready to begin) and `ACTION`, the action's
 *    name;
 *  - `Params`, with their table parameters(Params&) and validate(), `DriverParams node`, `VelocityLimits limits`, and
 *    `double patience() const`, the time [s] after which a goal without an input ends;
 *  - a constructor (DriverContext&, const Params&);
 *  - `std::unique_ptr<Task> prepare(const Goal&)`, without the mutex; may wait by DriverContext::waitFor(); throws to
 *    refuse. The node itself waits until somebody subscribes to the commands;
 *  and, all with the mutex held,
 *  - `void begin(std::unique_ptr<Task>)`, and `void end()`, which forgets the goal, if there is one;
 *  - `Progress progress() const` of a goal that has begun;
 *  - `Velocity wanted(double time)`, the velocity before limits (times are those of ROS [s]);
 *  - `void sent(double time, const Velocity&)`, called with each command that a robot follows: not in a dry run;
 *  - `void onMissingInput(double time, const std::string& what)`, called in each cycle in which the robot stands for
 *    lack of it;
 *  - `void publish(const Velocity&)`, which publishes a command, and `bool hasListener() const`, whether somebody
 *    subscribes;
 *  - `std::optional<double> takeLatency()`: time from an input to the command just sent [ms], once for each input:
 *    empty when an earlier command has followed the newest input;
 *  - `void fill(ServoStatus&) const`, `void fill(Result&) const`, `void fill(Feedback&, const ServoStatus&) const`;
 *  - `void diagnose(diagnostic_updater::DiagnosticStatusWrapper&) const`;
 *  - `std::string idleView() const`: the view that is wanted while there is no goal; empty: none.
 */
template <typename Driver>
class DriverNode : public DriverContext
{
public:
  DriverNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : DriverNode(nh, private_nh, readParams<Params>(private_nh))
  {
  }

  ~DriverNode()
  {
    control_timer_.stop();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    goal_thread_.join();
    for (ros::Subscriber& subscriber : subscribers_)
    {
      subscriber.shutdown();
    }
  }

  /** Ends the goal and sends zero; after that, nothing drives the robot any more. */
  void stop()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!std::exchange(stopping_, true))
    {
      guarded("the last cycle", [this] { cycle(); });
      sendZero();
    }
    wake_.notify_all();
  }

private:
  using Clock = std::chrono::steady_clock;
  using Action = typename Driver::Action;
  using Order = typename Action::_action_goal_type::_goal_type;
  using Result = typename Action::_action_result_type::_result_type;
  using Feedback = typename Action::_action_feedback_type::_feedback_type;
  using Server = actionlib::ActionServer<Action>;
  using Handle = typename Server::GoalHandle;
  using Velocity = typename Driver::Velocity;
  using Params = typename Driver::Params;

  static constexpr const char* STOP_TOPIC = "stop";
  static constexpr double LEAST_LIMIT = 1e-3;  // of speeds and accelerations that people choose [SI units]

  enum class Stage
  {
    ACCEPTED,   ///< the goal thread has not begun with it
    PREPARING,  ///< in the goal thread
    RUNNING     ///< it has begun
  };

  /** A goal on its way. */
  struct Goal
  {
    Handle handle;
    Order order;           ///< the goal's message
    std::string id;        ///< actionlib's id of the goal
    double timeout;        ///< the goal ends after this time [s]
    std::uint64_t serial;  ///< different for each goal, so that prepareGoals() sees whether its goal is still there
    Clock::time_point start = Clock::now();
    Stage stage = Stage::ACCEPTED;
    bool cancelled = false;
  };

  DriverNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const Params& params)
    : DriverContext(nh, private_nh, params.node.dry_run),
      params_(params),
      limiter_(params_.limits),
      status_(nh_),
      server_(nh_, Driver::ACTION, false),
      driver_(*this, params_)
  {
    start_patience_ = params_.node.start_patience;
    listen<std_msgs::Bool>(STOP_TOPIC, 5,
                           [this](const std_msgs::Bool::ConstPtr& message) { held_ = message->data != 0; });
    enable_service_ = serve("enable", &DriverNode::enable, this);
    diagnostics_.add(Driver::ACTION, this, &DriverNode::diagnose);
    status_.publish(idleStatus(gate_));
    publishWantedView(driver_.idleView(), "");
    // Called with the action server's lock held.
    server_.registerGoalCallback([this](Handle handle) { new_goals_.put(handle); });
    server_.registerCancelCallback([this](Handle handle) { cancelled_goals_.put(handle); });
    server_.start();
    goal_thread_ = std::thread([this] { prepareGoals(); });
    VelocityLimits limits = params_.limits;
    live_groups_.insert(
        live_groups_.begin(),
        liveGroup<VelocityLimits>(
            limits,
            upToNow(parameters(limits), { "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration" },
                    LEAST_LIMIT),
            [this](const VelocityLimits& live) { locked([&] { limiter_.setLimits(live); }); }));
    live_parameters_ = std::make_unique<LiveParameters>(private_nh_, live_groups_);
    control_timer_ = every(1.0 / params_.node.control_rate, "control",
                           [this] { runLocked("a cycle of control", [this] { cycle(); }); });
  }

  void enable(const std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response)
  {
    // A goal ends at once, not only if the gate is still closed in the next cycle.
    locked([&] {
      response = gate_.set(request.data != 0);
      if (goal_ && !gate_.open())
      {
        finish(false, "disabled");
      }
    });
  }

  // ------------------------------------------------------------------------------------------------ the driver's view

  std::string goalId() const override
  {
    return goal_ ? goal_->id : "";
  }
  bool goalRuns() const override
  {
    return goal_ && goal_->stage == Stage::RUNNING;
  }
  bool preparing() const override
  {
    return !stopping_ && goal_ && goal_->stage == Stage::PREPARING && goal_->serial == prepared_serial_;
  }
  void abort(std::string reason) override
  {
    if (goal_)
    {
      finish(false, std::move(reason));
    }
  }

  // --------------------------------------------------------------------------------------------------------- goals

  /**
   * The newest goal that has come since the last call; empty: none. Ends older ones, and marks or ends cancelled ones.
   */
  std::optional<Handle> takeNewGoal()
  {
    std::optional<Handle> newest;
    for (Handle& handle : new_goals_.takeAll())
    {
      refuse(newest, "another goal has come");
      newest = handle;
    }
    for (const Handle& handle : cancelled_goals_.takeAll())
    {
      if (newest && *newest == handle)
      {
        refuse(newest, "the goal was cancelled");
      }
      else if (goal_ && goal_->handle == handle)
      {
        goal_->cancelled = true;
      }
    }
    return newest;
  }

  /** Ends a goal that was not accepted, and resets `handle`. */
  static void refuse(std::optional<Handle>& handle, const std::string& reason)
  {
    if (handle)
    {
      Result result;
      result.message = reason;
      handle->setCanceled(result, reason);
      handle.reset();
    }
  }

  /**
   * Makes a goal the present one, which must not exist yet, and has it prepared; ends it at once when the gate is
   * closed.
   */
  void accept(Handle handle)
  {
    handle.setAccepted();
    const Order order = *handle.getGoal();
    const bool own = order.timeout > 0.0 && std::isfinite(order.timeout);
    driver_.end();
    waiting_for_ = "the goal is being prepared";
    goal_ = Goal{ handle, order, handle.getGoalID().id, own ? order.timeout : params_.node.timeout, ++serials_ };
    // A cancellation that came before the goal was taken matched nothing, and actionlib tells of it but once.
    goal_->cancelled = handle.getGoalStatus().status == actionlib_msgs::GoalStatus::PREEMPTING;
    if (!gate_.open())
    {
      finish(false, "disabled: call ~enable first");
      return;
    }
    wake_.notify_all();
  }

  /** The goal thread: prepares one goal after the other, and begins or refuses it. */
  void prepareGoals()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true)
    {
      wake_.wait(lock, [this] { return stopping_ || (goal_ && goal_->stage == Stage::ACCEPTED); });
      if (stopping_)
      {
        return;
      }
      goal_->stage = Stage::PREPARING;
      const std::uint64_t serial = prepared_serial_ = goal_->serial;
      const Order order = goal_->order;
      lock.unlock();
      std::unique_ptr<typename Driver::Task> task;
      std::string refusal;
      try
      {
        task = driver_.prepare(order);
        waitFor([this] {
          const bool listened = locked([this] { return gate_.dryRun() || driver_.hasListener(); });
          return listened ? "" : "nobody listens on '" + resolved(commandTopic()) + "'";
        });
      }
      catch (const std::exception& error)
      {
        refusal = oneLine(error);
      }
      catch (...)
      {
        refusal = "unknown exception";
      }
      lock.lock();
      if (goal_ && goal_->serial == serial && !stopping_)
      {
        task ? begin(std::move(task)) : finish(false, refusal.empty() ? "refused without a reason" : refusal);
      }
    }
  }

  /** Begins the present goal, which is prepared. */
  void begin(std::unique_ptr<typename Driver::Task> task)
  {
    limiter_.stop();
    missing_since_.reset();
    goal_->stage = Stage::RUNNING;
    const std::string fault = guarded("the goal's begin", [&] { driver_.begin(std::move(task)); });
    for (const std::unique_ptr<DriverInput>& input : inputs_)
    {
      input->restart();
    }
    if (!fault.empty())
    {
      abort(fault);
    }
  }

  /** Stops the robot, then ends the goal and publishes why. The reason is a copy: it may be part of what ends here. */
  void finish(bool success, const std::string reason)  // NOLINT(performance-unnecessary-value-param)
  {
    if (goal_->stage == Stage::RUNNING || burst_.due())
    {
      sendZero();
    }
    Goal goal = *std::exchange(goal_, std::nullopt);
    Result result;
    ServoStatus status = makeStatus(success        ? ServoStatus::CONVERGED
                                    : gate_.open() ? ServoStatus::ABORTED
                                                   : ServoStatus::DISABLED,
                                    reason);
    guarded("the goal's result", [&] {
      driver_.fill(status);
      driver_.fill(result);
      fillFinal(result, status, 0);
    });
    result.success = success ? 1 : 0;
    result.message = reason;
    result.duration = secondsSince(goal.start);
    driver_.end();
    publishWantedView(driver_.idleView(), "");
    status_.publish(status);
    if (success)
    {
      goal.handle.setSucceeded(result, reason);
    }
    else if (goal.cancelled || replaced_)
    {
      goal.handle.setCanceled(result, reason);
    }
    else
    {
      goal.handle.setAborted(result, reason);
    }
  }

  /** Sets the field `final` of results that have a status there. */
  template <typename R>
  static auto fillFinal(R& result, const ServoStatus& status, int /*preferred*/)
      -> decltype(result.final = status, void())
  {
    result.final = status;
  }
  template <typename R>
  static void fillFinal(R& /*result*/, const ServoStatus& /*status*/, long /*otherwise*/)
  {
  }

  // ------------------------------------------------------------------------------------------------------- control

  /**
   * One cycle of control: takes goals and cancellations, judges the present goal, and sends a command where one is due.
   */
  void cycle()
  {
    const ros::Time now = ros::Time::now();
    constexpr double CLOCK_STEP = 0.5;  // back, that a clock makes by itself at most [s]
    const double back = secondsBetween(now, std::exchange(last_now_, now));
    const std::string jump = back > CLOCK_STEP ? "time has gone back by " + seconds(back) + " in the clock" : "";
    std::optional<Handle> next = takeNewGoal();
    replaced_ = next.has_value();
    if (goal_)
    {
      control(now.toSec(), jump);
    }
    replaced_ = false;
    if (next)
    {
      stopping_ ? refuse(next, "the node is shutting down") : accept(*next);
    }
    if (!goal_)
    {
      idle();
    }
  }

  /** Judges the goal, and drives, stands or ends it. */
  void control(double now, const std::string& jump)
  {
    const bool runs = goalRuns();
    Circumstances circumstances;
    circumstances.shutting_down = stopping_;
    circumstances.replaced = replaced_;
    circumstances.enabled = gate_.open();
    circumstances.cancelled = goal_->cancelled;
    circumstances.has_listener = gate_.dryRun() || driver_.hasListener();
    circumstances.elapsed = secondsSince(goal_->start);
    circumstances.timeout = goal_->timeout;
    circumstances.fault = jump;
    circumstances.patience = params_.patience();
    circumstances.missing_input = runs ? missingInput() : "";
    circumstances.held = held_ ? "held: the last word on " + quoted(STOP_TOPIC) + " is true" : "";
    if (circumstances.missing_input.empty())
    {
      missing_since_.reset();
    }
    else
    {
      missing_since_ = missing_since_.value_or(Clock::now());
      circumstances.missing_for = secondsSince(*missing_since_);
    }
    const Progress progress = runs ? driver_.progress() : Progress{ Progress::PREPARING, waiting_for_ };
    const Verdict verdict = judge(circumstances, progress);
    switch (verdict.what)
    {
      case Verdict::DRIVE:
        drive(now, verdict.reason);
        break;
      case Verdict::STAND:
        stand(now, progress, circumstances.missing_input, verdict.reason);
        break;
      default:
        finish(verdict.what == Verdict::SUCCEED, verdict.reason);
    }
  }

  void drive(double now, const std::string& reason)
  {
    const Velocity velocity = limiter_.next(driver_.wanted(now), 1.0 / params_.node.control_rate);
    send(velocity);
    reportSent(now, velocity);
    publishProgress(ServoStatus::SERVOING, reason);
  }

  void stand(double now, const Progress& progress, const std::string& missing, const std::string& reason)
  {
    if (goal_->stage != Stage::RUNNING)
    {
      sendDueZero();
    }
    else
    {
      sendZero();
      if (!missing.empty())
      {
        driver_.onMissingInput(now, missing);
      }
      reportSent(now, Velocity::Zero());
    }
    const bool lost = progress.state == Progress::LOST || !missing.empty() || held_;
    publishProgress(lost ? ServoStatus::LOST : ServoStatus::ACQUIRING, reason);
  }

  /** Tells the driver of a command, unless it is a dry run, in which no robot follows it. */
  void reportSent(double now, const Velocity& velocity)
  {
    if (!gate_.dryRun())
    {
      driver_.sent(now, velocity);
    }
  }

  void publishProgress(std::uint8_t state, const std::string& reason)
  {
    ServoStatus status = makeStatus(state, reason);
    driver_.fill(status);
    status_.publish(status);
    const std::optional<double> age = driver_.takeLatency();
    if (age)
    {
      latencies_.add(*age);
      Feedback feedback;
      driver_.fill(feedback, status);
      goal_->handle.publishFeedback(feedback);
    }
  }

  void idle()
  {
    sendDueZero();
    const ServoStatus& last = status_.last();
    if (isOutdated(last, gate_))
    {
      ServoStatus status = idleStatus(gate_);
      const bool ended = last.state == ServoStatus::CONVERGED || last.state == ServoStatus::ABORTED;
      status.reason += ended ? LAST_GOAL + last.reason : "";
      status_.publish(status);
    }
  }

  void sendDueZero()
  {
    if (burst_.due())
    {
      sendZero();
    }
  }

  void sendZero()
  {
    limiter_.stop();
    send(Velocity::Zero());
  }

  void send(const Velocity& velocity)
  {
    driver_.publish(velocity);
    burst_.sent(velocity.isZero());
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ServoStatus& last = status_.last();
    const bool worrying = last.state == ServoStatus::LOST || last.state == ServoStatus::ABORTED;
    status.summary(worrying ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   last.reason);
    status.add("Enabled", gate_.enabled());
    status.add("Dry run", gate_.dryRun());
    latencies_.report(status, "Image to command");
    for (const std::unique_ptr<DriverInput>& input : inputs_)
    {
      status.add("Age of " + input->what() + " [s]", input->age());
    }
    driver_.diagnose(status);
  }

  const Params params_;
  Inbox<Handle> new_goals_;
  Inbox<Handle> cancelled_goals_;

  // What follows is guarded by mutex_.
  std::condition_variable wake_;
  typename Driver::Limiter limiter_;
  StopBurst burst_;
  std::optional<Clock::time_point> missing_since_;  // since when an input is missing; empty while all come
  ros::Time last_now_;                              // ROS' time in the last cycle
  std::uint64_t serials_ = 0;                       // number of goals accepted so far
  std::uint64_t prepared_serial_ = 0;               // Goal::serial of the one in the goal thread
  bool replaced_ = false;                           // another goal has come in this cycle
  bool stopping_ = false;                           // the node ends
  Timings latencies_;                               // from an image to the command that follows it

  StatusOutput status_;
  Server server_;
  std::optional<Goal> goal_;  // ends before the server that its handle belongs to
  Driver driver_;
  ros::ServiceServer enable_service_;
  bool held_ = false;  // by `stop`
  std::thread goal_thread_;
  ros::SteadyTimer control_timer_;
  std::unique_ptr<LiveParameters> live_parameters_;
};

}  // namespace view_servo
