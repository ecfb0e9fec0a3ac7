// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "played_driver.h"

#include "view_servo/HomeToViewAction.h"
#include "view_servo/ros/driver_node.h"

#include <rapidcheck.h>
#include <std_msgs/Bool.h>
#include <std_srvs/SetBool.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace test
{
/** What the commands so far make of the driver: the states that it has to be in. */
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

}  // namespace test
}  // namespace view_servo
