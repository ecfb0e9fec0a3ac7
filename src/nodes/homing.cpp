// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/base_driver.h"
#include "nodes/nodes.h"

#include "view_servo/HomeToViewAction.h"
#include "view_servo/WantedView.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/idle_view.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/view_homing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
/** A goal's views in the order of driving. */
struct HomingStages
{
  std::vector<std::shared_ptr<HomingTask>> tasks;
  std::size_t at = 0;  // the one that the base is driven to

  bool atLast() const
  {
    return at + 1 == tasks.size();
  }
  /** Which of several views this is about, to begin a line with; empty when there is one only. */
  std::string where() const
  {
    return tasks.size() == 1 ? ""
                             : "view '" + tasks[at]->view + "', " + std::to_string(at + 1) + " of " +
                                   std::to_string(tasks.size()) + ": ";
  }
};

}  // namespace

/**
 * Drives a mobile base back to where a view was stored. Private parameters: see HomingDriverParams.
 *
 * Subscribes:
 *  - `image_raw`, `camera_info`: see CameraInput;
 *  - `point_matches` (view_servo/PointMatches), `line_matches` (view_servo/LineMatches), of matchers that follow
 *    `~wanted_view`: either may be silent;
 *  - `odom` (nav_msgs/Odometry), of `~base_frame`; tf;
 *  - `learn_view` (view_servo/WantedView): the view to learn while somebody drives the base away from it.
 *
 * Publishes, besides what every driver does (see DriverNode):
 *  - `cmd_vel` (geometry_msgs/Twist, in base_link) and `cmd_vel_stamped`, or `cmd_vel_dry` and `cmd_vel_dry_stamped`;
 *    zero for a while after each end, then nothing;
 *  - `heading` (view_servo/Heading): for each image; `heading_arrow` (geometry_msgs/PoseStamped): the same for rviz, at
 *    the base, its x axis towards the view, while there is a heading. `view_pose` and `base_pose`
 *    (geometry_msgs/PoseWithCovarianceStamped);
 *  - `~markers` (visualization_msgs/MarkerArray): see ViewHoming.
 * Action: `home` (view_servo/HomeToView). All views of a goal are read before anything moves. Between two of them the
 * base stands until a matcher has found the next one.
 *
 * A thread of the driver's own works on images and matches, and leaves a Course; every cycle of control follows it by
 * the newest odometry, also while an image is worked on.
 */
class HomingDriver : public BaseDriver
{
public:
  using Action = HomeToViewAction;
  using Task = HomingStages;
  using Params = HomingDriverParams;
  static constexpr const char* ACTION = "home";

  HomingDriver(DriverContext& context, const Params& params)
    : BaseDriver(homing_),
      context_(context),
      params_(params),
      idle_view_(params.view),
      homing_(context, params_,
              { [this] { forgetOverdueLesson(); },
                {},
                [this] { goOnAfterArrival(); },
                [this](const HomingOutcome& outcome) {
                  if (storeStructure(homing_.viewStore(), outcome))
                  {
                    context_.runLocked("the end of a lesson", [&] { endLesson(outcome.task->view); });
                  }
                },
                [this](const CameraFrame& frame) {
                  watchView(frame);
                } })
  {
    homing_.expectView(params.view, "");
    context.listen<WantedView>("learn_view", 1, [this](const WantedView::ConstPtr& m) { learn(m->view); });
  }

  // -------------------------------------------------------------------------------------------------------- goals

  std::unique_ptr<Task> prepare(const HomeToViewGoal& goal)
  {
    if (!(goal.timeout >= 0.0 && std::isfinite(goal.timeout)) || !(goal.step >= 0.0 && std::isfinite(goal.step)))
    {
      throw std::invalid_argument("timeout and step must be finite and not negative");
    }
    std::vector<LearntView> stored;
    for (const std::string& view : viewsOf(goal))
    {
      stored.push_back(loadLearntView(homing_.viewStore(), view));
    }
    const CameraFrame frame = homing_.waitForInputs(stored.front().view.name);
    HomingParams homing = params_.homing;
    if (goal.step > 0.0)
    {
      homing.step = goal.step;
      homing.near_step = std::min(homing.near_step, goal.step);
    }
    auto stages = std::make_unique<Task>();
    for (const LearntView& view : stored)
    {
      stages->tasks.push_back(homing_.makeTask(view, frame, homing));
    }
    homing_.waitForAnswer();
    return stages;
  }

  void begin(std::unique_ptr<Task> stages)
  {
    stages_ = std::move(stages);
    homing_.setTask(stages_->tasks.front());
    homing_.restartWay();
  }

  void end()
  {
    stages_.reset();
    homing_.setTask(nullptr);
    homing_.expectView(idle_view_.name(), "");
  }

  std::string idleView() const
  {
    return idle_view_.name();
  }

  // ------------------------------------------------------------------------------------------------------ control

  Progress progress() const
  {
    Progress progress = toProgress(homing_.report());
    progress.reason = stages_->where() + progress.reason;
    if (progress.state == Progress::ARRIVED && !stages_->atLast())
    {
      progress.state = Progress::ACQUIRING;  // matches may say so, and the next view is wanted with the next image
    }
    return progress;
  }
  Velocity wanted(double /*time*/) const
  {
    return homing_.velocity();
  }

  // ----------------------------------------------------------------------------------------------------- messages

  using BaseDriver::fill;

  void fill(HomeToViewResult& result) const
  {
    result.final = toHeading(homing_.report(), homing_.baseFrame());
    result.travelled = homing_.task() ? homing_.travelled() : 0.0;
    if (stages_)
    {
      result.reached = static_cast<int>(stages_->at) + (homing_.report().state == HomingState::ARRIVED ? 1 : 0);
    }
  }

  void fill(HomeToViewFeedback& feedback, const ServoStatus& /*status*/) const
  {
    feedback.heading = toHeading(homing_.report(), homing_.baseFrame());
    feedback.manoeuvre = homing_.report().manoeuvre;
    feedback.view = stages_->tasks[stages_->at]->view;
    feedback.number = static_cast<int>(stages_->at) + 1;
    feedback.count = static_cast<int>(stages_->tasks.size());
  }

private:
  using Clock = std::chrono::steady_clock;

  /** Names of the goal's views. @throws std::invalid_argument. */
  std::vector<std::string> viewsOf(const HomeToViewGoal& goal) const
  {
    if (!goal.views.empty() && !goal.view.empty())
    {
      throw std::invalid_argument("the goal has both a view and a list of views: leave one of them empty");
    }
    std::vector<std::string> views = goal.views;
    if (views.empty())
    {
      views.push_back(goal.view.empty() ? params_.view : goal.view);
    }
    if (views.front().empty() && goal.views.empty())
    {
      throw std::invalid_argument("the goal names no view, and ~view is not set");
    }
    return views;
  }

  /** The base is at a view that is not the last: the next one is wanted. It stands until there is a way to that. */
  void goOnAfterArrival()
  {
    if (!stages_ || stages_->atLast() || homing_.report().state != HomingState::ARRIVED)
    {
      return;
    }
    ROS_INFO_STREAM(stages_->where() << homing_.report().reason);
    const std::shared_ptr<HomingTask>& next = stages_->tasks[++stages_->at];
    homing_.expectView(next->view, context_.goalId());
    context_.requestNextView(next->view);
    homing_.setTask(next);
  }

  /** From now on a view is followed without a goal until it is learnt; empty: the one of the parameters again. */
  void learn(const std::string& view)
  {
    idle_view_.learn(view);
    if (context_.goalId().empty())
    {
      homing_.setTask(nullptr);
      homing_.expectView(idle_view_.name(), "");
      context_.requestIdleView(idle_view_.name());
    }
  }

  void endLesson(const std::string& view)
  {
    if (idle_view_.toBeLearnt() == view)
    {
      learn("");
    }
  }

  void forgetOverdueLesson()
  {
    if (idle_view_.overdue())
    {
      ROS_WARN_STREAM("view '" << idle_view_.toBeLearnt() << "' is not learnt: the base has not moved away from it");
      learn("");
    }
  }

  /** Without a goal, the direction of a view is estimated all the same. By the worker's thread. */
  void watchView(const CameraFrame& frame)
  {
    constexpr std::chrono::seconds PERIOD(1);
    constexpr double NEVER = 1e9;  // [s]
    const auto [view, lesson] =
        context_.locked([this] { return std::pair(idle_view_.name(), !idle_view_.toBeLearnt().empty()); });
    if (view.empty() || Clock::now() < next_watch_)
    {
      return;
    }
    next_watch_ = Clock::now() + PERIOD;
    try
    {
      HomingParams homing = params_.homing;
      homing.dwell = lesson ? NEVER : homing.dwell;  // it begins where the view was stored
      const std::shared_ptr<HomingTask> task =
          homing_.makeTask(loadLearntView(homing_.viewStore(), view), frame, homing);
      task->lesson = lesson;
      context_.runLocked("the watch for a view", [&] {
        if (!homing_.task() && context_.goalId().empty() && idle_view_.name() == task->view)
        {
          homing_.setTask(task);
        }
      });
    }
    catch (const std::exception& error)
    {
      ROS_WARN_STREAM_THROTTLE(10.0, "view '" << view << "' is not watched: " << oneLine(error));
    }
  }

  DriverContext& context_;
  const Params params_;
  IdleView idle_view_;
  std::unique_ptr<HomingStages> stages_;  // of the goal that runs
  Clock::time_point next_watch_;          // the worker's thread's alone
  ViewHoming homing_;
};

const NodeType HOMING = driverType<DriverNode<HomingDriver>>("homing");

}  // namespace view_servo
