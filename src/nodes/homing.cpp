// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/WantedView.h"
#include "view_servo/control/motion_watch.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/base_output.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/homing_worker.h"
#include "view_servo/ros/idle_view.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/odometry_input.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/ros/view_answer.h"
#include "view_servo/views/view_store.h"

#include <nav_msgs/Odometry.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
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
 *  - `cmd_vel` (geometry_msgs/Twist, in base_link) and `cmd_vel_stamped`, or `cmd_vel_dry` and `cmd_vel_dry_stamped`; zero
 *    for a while after each end, then nothing;
 *  - `heading` (view_servo/Heading): for each image; `heading_arrow` (geometry_msgs/PoseStamped): the same for rviz, at
 *    the base, its x axis towards the view, while there is a heading. `view_pose` (geometry_msgs/PoseWithCovarianceStamped).
 * Action: `home` (view_servo/HomeToView).
 *
 * A thread of the driver's own works on images and matches, and leaves a Course; every cycle of control follows it by the
 * newest odometry, also while an image is worked on.
 */
class HomingDriver
{
public:
  using Action = HomeToViewAction;
  using Velocity = BaseVelocity;
  using Limiter = BaseVelocityLimiter;
  using Task = std::shared_ptr<HomingTask>;
  using Params = HomingDriverParams;
  static constexpr const char* ACTION = "home";

  HomingDriver(DriverContext& context, const Params& params)
    : context_(context),
      params_(params),
      idle_view_(params.view),
      base_frame_(withoutSlash(params.base_frame)),
      images_(context.addInput("image", context.quoted("image_raw"), params.image_timeout)),
      outcomes_(context.addInput("image that was worked on", context.quoted("image_raw"),
                                 OUTCOME_PATIENCE * params.image_timeout)),
      odometry_(context, transforms_, base_frame_, params.odometry_timeout, params.odometry_delay,
                [this](const nav_msgs::Odometry& message) { onOdometry(message); }),
      matches_(context.addInput("matches", context.quoted("point_matches") + " or " + context.quoted("line_matches"),
                                params.match_timeout)),
      points_("matches", context.resolved("point_matches")),
      lines_("matches", context.resolved("line_matches")),
      store_(viewsDir(params.views_dir)),
      output_(context.nodeHandle(), context.commandTopic(), base_frame_),
      worker_(
          [this](const HomingOutcome& outcome) {
            context_.runLocked("the outcome of an image", [&] { onOutcome(outcome); });
            if (storeStructure(store_, outcome))
            {
              context_.runLocked("the end of a lesson", [&] { endLesson(outcome.task->view); });
            }
          },
          [this](const CameraFrame& frame) { watchView(frame); }),
      camera_(
          context.nodeHandle(), params.camera,
          [this](const CameraFrame& frame) {
            context_.runLocked("an image on " + images_.topics(), [&] { onFrame(frame); });
          },
          [this](const std::string& problem) { context_.locked([&] { images_.reject(problem); }); })
  {
    images_.setMaxAge(params.camera.max_image_age);
    matches_.followPace(3.0);
    context.listen<WantedView>("learn_view", 1, [this](const WantedView::ConstPtr& m) { learn(m->view); });
    context.diagnostics().add("camera", &camera_, &CameraInput::diagnose);
    want(params_.view, "");
    context.listen<PointMatches>("point_matches", 1, [this](const PointMatches::ConstPtr& m) {
      onMatches(points_.add(*m), m->header, m->matches);
    });
    context.listen<LineMatches>(
        "line_matches", 1, [this](const LineMatches::ConstPtr& m) { onMatches(lines_.add(*m), m->header, m->points); });
  }

  // -------------------------------------------------------------------------------------------------------- goals

  std::unique_ptr<Task> prepare(const HomeToViewGoal& goal)
  {
    if (!(goal.timeout >= 0.0 && std::isfinite(goal.timeout)) || !(goal.step >= 0.0 && std::isfinite(goal.step)))
    {
      throw std::invalid_argument("timeout and step must be finite and not negative");
    }
    const std::string view = goal.view.empty() ? params_.view : goal.view;
    if (view.empty())
    {
      throw std::invalid_argument("the goal names no view, and ~view is not set");
    }
    const LearntView stored = loadLearntView(store_, view);
    context_.locked([&] { want(view, context_.goalId()); });
    context_.requestView(view);
    // Only an image that has come since: the camera may be another than it was.
    CameraFrame before;
    CameraFrame frame;
    camera_.missing(before);
    context_.waitFor([&] { return camera_.missing(frame, before); });
    context_.waitFor([this] { return context_.locked([this] { return odometryLacks(); }); });
    context_.waitFor([&] { return transforms_.missing(base_frame_, frame.image->header.frame_id, ros::Time(0)); });
    HomingParams homing = params_.homing;
    if (goal.step > 0.0)
    {
      homing.step = goal.step;
      homing.near_step = std::min(homing.near_step, goal.step);
    }
    auto task = std::make_unique<Task>(makeTask(stored, frame, homing));
    context_.waitFor([this] { return context_.locked([this] { return missingAnswer({ &points_, &lines_ }); }); });
    return task;
  }

  void begin(std::unique_ptr<Task> task)
  {
    setTask(*task);
    travelled_ = 0.0;
  }

  void end()
  {
    setTask(nullptr);
    want(idle_view_.name(), "");
  }

  std::string idleView() const
  {
    return idle_view_.name();
  }

  // ------------------------------------------------------------------------------------------------------ control

  Progress progress() const
  {
    return toProgress(report_);
  }

  /** The base stands already at the first image whose stamp is apart from odometry's. */
  Velocity wanted(double /*time*/) const
  {
    return base_in_odom_ && odd_stamps_ == 0 ? along(course_, *base_in_odom_) : Velocity(Velocity::Zero());
  }

  void sent(double time, const Velocity& velocity)
  {
    motion_.addCommand(time, velocity);
  }
  static void onMissingInput(double /*time*/, const std::string& /*why*/)
  {
  }

  bool hasListener() const
  {
    return output_.hasListener();
  }

  void publish(const Velocity& velocity) const
  {
    output_.publish(velocity);
  }

  std::optional<double> takeLatency()
  {
    using Milliseconds = std::chrono::duration<double, std::milli>;
    const std::optional<Clock::time_point> time = std::exchange(unanswered_, std::nullopt);
    return time ? std::make_optional(Milliseconds(Clock::now() - *time).count()) : std::nullopt;
  }

  // ----------------------------------------------------------------------------------------------------- messages

  void fill(ServoStatus& status) const
  {
    status.translation_error = report_.distance;
    status.rotation_error = std::abs(report_.yaw_error);
    status.point_error = report_.displacement;
    status.inliers = report_.inliers;
  }

  void fill(HomeToViewResult& result) const
  {
    result.final = toHeading(report_, base_frame_);
    result.travelled = task_ ? travelled_ : 0.0;
  }

  void fill(HomeToViewFeedback& feedback, const ServoStatus& /*status*/) const
  {
    feedback.heading = toHeading(report_, base_frame_);
    feedback.manoeuvre = report_.manoeuvre;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
  {
    status.add("View", points_.view());
    status.add("Inliers", report_.inliers);
    status.add("Odometry delay [s]", odometry_.measuredDelay());
    if (const std::string advice = odometry_.adviceOnDelay(); !advice.empty())
    {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, advice);
    }
  }

private:
  using Clock = std::chrono::steady_clock;

  void want(const std::string& view, const std::string& goal)
  {
    points_.want(view, goal);
    lines_.want(view, goal);
  }

  /** From now on a view is followed without a goal until it is learnt; empty: the one of the parameters again. */
  void learn(const std::string& view)
  {
    idle_view_.learn(view);
    if (context_.goalId().empty())
    {
      setTask(nullptr);
      want(idle_view_.name(), "");
      context_.requestIdleView(idle_view_.name());
    }
  }

  void endLesson(const std::string& view)
  {
    if (idle_view_.learnt() == view)
    {
      learn("");
    }
  }

  /** Replaces the task, and forgets all that belongs to the old one; null: no task. */
  void setTask(std::shared_ptr<HomingTask> task)
  {
    task_ = std::move(task);
    report_ = HomingReport();
    course_ = Course();
    unanswered_.reset();
    odd_stamps_ = 0;
    matches_.setNeeded(true);
    motion_.clear();
    worker_.setTask(task_);
  }

  // --------------------------------------------------------------------------------------- what a goal waits for

  std::string odometryLacks() const
  {
    const DriverInput& odometry = odometry_.input();
    if (base_in_odom_ && odometry.age() <= params_.odometry_timeout)
    {
      return stampsApart(odometry, images_);
    }
    return odometry.problem().empty() ? "no odometry has come on " + odometry.topics() : odometry.problem();
  }

  std::shared_ptr<HomingTask> makeTask(const LearntView& stored, const CameraFrame& frame,
                                       const HomingParams& params) const
  {
    const CameraMount mount(
        toIsometry(transforms_.lookUp(base_frame_, frame.image->header.frame_id, ros::Time(0), 0.0).transform));
    return makeHomingTask(stored, frame.info, mount, params);
  }

  // ------------------------------------------------------------------------------------------------------- inputs

  void endIfTimeWentBack(const DriverInput& input)
  {
    if (!input.jump().empty())
    {
      context_.abort(input.jump());
      setTask(nullptr);
    }
  }

  void onFrame(const CameraFrame& frame)
  {
    const DriverInput::Stamp place = images_.checkStamp(frame.image->header.stamp);
    endIfTimeWentBack(images_);
    if (place != DriverInput::Stamp::NEWEST)
    {
      return;
    }
    images_.accept();
    if (idle_view_.overdue())
    {
      ROS_WARN_STREAM("view '" << idle_view_.learnt() << "' is not learnt: the base has not moved away from it");
      learn("");
    }
    if (task_ && !sameCalibration(*task_->info, *frame.info))
    {
      context_.abort("the camera's calibration has changed");
      setTask(nullptr);
    }
    const std::string apart = stampsApart(odometry_.input(), images_);
    odd_stamps_ = apart.empty() ? 0 : odd_stamps_ + 1;
    if (odd_stamps_ >= ODD_STAMPS)
    {
      context_.abort(apart);
    }
    worker_.addFrame(frame);
  }

  void onOdometry(const nav_msgs::Odometry& message)
  {
    const std::optional<OdometryReading> reading = odometry_.read(message);
    endIfTimeWentBack(odometry_.input());
    if (!reading)
    {
      return;
    }
    worker_.addOdometry(reading->time, reading->pose);
    if (reading->place == DriverInput::Stamp::NEWEST)
    {
      travelled_ += base_in_odom_ ? compose(inverse(*base_in_odom_), reading->pose).distance() : 0.0;
      base_in_odom_ = reading->pose;
      if (const std::string fault = motion_.addOdometry(ros::Time::now().toSec(), reading->pose); !fault.empty())
      {
        context_.abort(fault);
      }
    }
  }

  void onMatches(bool wanted, const std_msgs::Header& header, const std::vector<PointMatch>& matches)
  {
    if (!wanted)
    {
      const std::string& other = points_.otherView().empty() ? lines_.otherView() : points_.otherView();
      matches_.reject(other.empty() ? points_.refusal() + lines_.refusal() : other);
      matches_.setNeeded(true);
      return;
    }
    matches_.accept();
    worker_.addMatches(header.stamp.toSec(), toHeadingEvidence(matches));
  }

  // ------------------------------------------------------------------------------------------- images and matches

  void onOutcome(const HomingOutcome& outcome)
  {
    if (task_ != outcome.task)
    {
      return;
    }
    if (!outcome.fault.empty())
    {
      context_.abort("an image or matches cannot be used: " + outcome.fault);
      setTask(nullptr);
      return;
    }
    report_ = outcome.report;
    course_ = outcome.course;
    matches_.setNeeded(!report_.tracked || !matches_.problem().empty());
    odometry_.setRemainingDelay(report_.odometry_delay);
    if (const std::string advice = odometry_.adviceOnDelay(); !advice.empty())
    {
      ROS_WARN_STREAM_THROTTLE(10.0, advice);
    }
    if (!outcome.frame_time)
    {
      return;
    }
    outcomes_.accept();
    unanswered_ = outcome.frame_time;
    output_.publish(report_, odometry_.frame());
    const bool ended = report_.state == HomingState::ARRIVED || report_.state == HomingState::FAILED;
    if (ended && !context_.goalRuns())
    {
      setTask(nullptr);  // watched anew with the next image
    }
  }

  /** Without a goal, the direction of a view is estimated all the same. By the worker's thread. */
  void watchView(const CameraFrame& frame)
  {
    constexpr std::chrono::seconds PERIOD(1);
    constexpr double NEVER = 1e9;  // [s]
    const auto [view, lesson] =
        context_.locked([this] { return std::pair(idle_view_.name(), !idle_view_.learnt().empty()); });
    if (view.empty() || Clock::now() < next_watch_)
    {
      return;
    }
    next_watch_ = Clock::now() + PERIOD;
    try
    {
      HomingParams homing = params_.homing;
      homing.dwell = lesson ? NEVER : homing.dwell;  // it begins where the view was stored
      const std::shared_ptr<HomingTask> task = makeTask(loadLearntView(store_, view), frame, homing);
      task->lesson = lesson;
      context_.runLocked("the watch for a view", [&] {
        if (!task_ && context_.goalId().empty() && idle_view_.name() == task->view)
        {
          setTask(task);
        }
      });
    }
    catch (const std::exception& error)
    {
      ROS_WARN_STREAM_THROTTLE(10.0, "view '" << view << "' is not watched: " << oneLine(error));
    }
  }

  static constexpr int ODD_STAMPS = 3;             // images in a row whose stamps are apart from odometry's
  static constexpr double OUTCOME_PATIENCE = 4.0;  // times ~image_timeout

  DriverContext& context_;
  const Params params_;
  IdleView idle_view_;
  const std::string base_frame_;
  DriverInput& images_;
  DriverInput& outcomes_;
  TransformSource transforms_;
  OdometryInput odometry_;
  DriverInput& matches_;
  ViewAnswer points_;
  ViewAnswer lines_;
  const ViewStore store_;
  const BaseOutput output_;

  std::shared_ptr<HomingTask> task_;  // the newest
  HomingReport report_;
  Course course_;
  std::optional<PlanarPose> base_in_odom_;
  MotionWatch motion_;
  double travelled_ = 0.0;
  int odd_stamps_ = 0;
  std::optional<Clock::time_point> unanswered_;  // when an image came that was worked on, until a command follows

  Clock::time_point next_watch_;  // the worker's thread's alone
  HomingWorker worker_;
  CameraInput camera_;
};

}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runControlNode<view_servo::DriverNode<view_servo::HomingDriver>>(argc, argv, "homing");
}
