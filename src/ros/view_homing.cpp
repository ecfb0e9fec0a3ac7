// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/view_homing.h"

#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/markers.h"

#include <nav_msgs/Odometry.h>

#include <cmath>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int ODD_STAMPS = 3;             // images in a row whose stamps are apart from odometry's
constexpr double OUTCOME_PATIENCE = 4.0;  // times ~image_timeout

template <typename... Arguments>
void call(const std::function<void(Arguments...)>& hook, const Arguments&... arguments)
{
  if (hook)
  {
    hook(arguments...);
  }
}

}  // namespace

ViewHoming::ViewHoming(DriverContext& context, const HomingDriverParams& params, Hooks hooks)
  : context_(context),
    params_(params),
    hooks_(std::move(hooks)),
    base_frame_(withoutSlash(params.base_frame)),
    images_(context.addInput("image", context.quoted("image_raw"), params.image_timeout)),
    outcomes_(context.addInput("image that was worked on", context.quoted("image_raw"),
                               OUTCOME_PATIENCE * params.image_timeout)),
    transforms_(context.nodeHandle()),
    odometry_(context, transforms_, base_frame_, params.odometry_timeout, params.odometry_delay,
              [this](const OdometryInput::Event& event) { onOdometry(event); }),
    matches_(context.addInput("matches", context.quoted("point_matches") + " or " + context.quoted("line_matches"),
                              params.match_timeout)),
    points_("matches", context.resolved("point_matches")),
    lines_("matches", context.resolved("line_matches")),
    store_(viewsDir(params.views_dir)),
    output_(context.nodeHandle(), context.commandTopic(), base_frame_),
    markers_(context.privateNodeHandle()),
    distance_tolerance_(params.homing.approach.distance_tolerance),
    yaw_tolerance_(params.homing.approach.yaw_tolerance),
    worker_(
        [this](const HomingOutcome& outcome) {
          context_.runLocked("the outcome of an image", [&] { onOutcome(outcome); });
          draw(outcome);
          if (hooks_.on_work)
          {
            hooks_.on_work(outcome);
          }
        },
        [this](const CameraFrame& frame) {
          if (hooks_.on_frame_without_task)
          {
            hooks_.on_frame_without_task(frame);
          }
        }),
    camera_(
        context.nodeHandle(), context.privateNodeHandle(), params.camera,
        [this](const CameraFrame& frame) {
          context_.runLocked("an image on " + images_.topics(), [&] { onFrame(frame); });
        },
        [this](const std::string& problem) { context_.locked([&] { images_.reject(problem); }); })
{
  context_.addLive(liveNumbers());
  images_.setMaxAge(params.camera.max_image_age);
  matches_.followPace(3.0);
  context.diagnostics().add("camera", &camera_, &CameraInput::diagnose);
  context.listen<PointMatches>("point_matches", 1, [this](const PointMatches::ConstPtr& m) {
    onMatches(points_.add(*m), m->header, m->matches);
  });
  context.listen<LineMatches>(
      "line_matches", 1, [this](const LineMatches::ConstPtr& m) { onMatches(lines_.add(*m), m->header, m->points); });
}

LiveGroup ViewHoming::liveNumbers()
{
  HomingParams started = params_.homing;
  std::vector<LiveNumber> numbers = aroundNow(parameters(started), { "gain", "turn_gain" }, LIVE_GAIN);
  const std::vector<LiveNumber> tolerances =
      aroundNow(parameters(started), { "distance_tolerance", "yaw_tolerance" }, LIVE_TOLERANCE);
  numbers.insert(numbers.end(), tolerances.begin(), tolerances.end());
  return liveGroup<HomingParams>(started, numbers, [this](const HomingParams& live) {
    gain_share_ = live.approach.gain / params_.homing.approach.gain;
    turn_gain_share_ = live.approach.turn_gain / params_.homing.approach.turn_gain;
    distance_tolerance_ = live.approach.distance_tolerance;
    yaw_tolerance_ = live.approach.yaw_tolerance;
  });
}

// ------------------------------------------------------------------------------------------------- what a goal needs

CameraFrame ViewHoming::waitForInputs(const std::string& view)
{
  context_.requestView(view, [&](const std::string& goal) { expectView(view, goal); });
  // Only an image that has come since: the camera may be another than it was.
  CameraFrame before;
  CameraFrame frame;
  camera_.missing(before);
  context_.waitFor([&] { return camera_.missing(frame, before); });
  context_.waitFor([this] { return context_.locked([this] { return odometryLacks(); }); });
  context_.waitFor([&] { return transforms_.missing(base_frame_, frame.image->header.frame_id, ros::Time(0)); });
  return frame;
}

void ViewHoming::waitForAnswer()
{
  context_.waitFor([this] { return context_.locked([this] { return missingAnswer({ &points_, &lines_ }); }); });
}

std::string ViewHoming::odometryLacks() const
{
  const DriverInput& odometry = odometry_.input();
  if (base_in_odom_ && odometry.age() <= params_.odometry_timeout)
  {
    return stampsApart(odometry, images_);
  }
  return odometry.problem().empty() ? "no odometry has come on " + odometry.topics() : odometry.problem();
}

std::shared_ptr<HomingTask> ViewHoming::makeTask(const LearntView& stored, const CameraFrame& frame,
                                                 const HomingParams& params) const
{
  const geometry_msgs::TransformStamped base_from_camera =
      transforms_.lookUp(base_frame_, frame.image->header.frame_id, ros::Time(0), 0.0);
  HomingParams live = params;
  live.approach.distance_tolerance = distance_tolerance_;
  live.approach.yaw_tolerance = yaw_tolerance_;
  return makeHomingTask(stored, frame.info, toIsometry(base_from_camera.transform), live);
}

// ------------------------------------------------------------------------------------------------ the task, control

void ViewHoming::expectView(const std::string& view, const std::string& goal)
{
  points_.expect(view, goal);
  lines_.expect(view, goal);
}

void ViewHoming::setTask(std::shared_ptr<HomingTask> task)
{
  task_ = std::move(task);
  report_ = HomingReport();
  course_ = Course();
  unanswered_.reset();
  odd_stamps_ = 0;
  does_without_matches_ = false;
  needMatches(true);
  motion_.clear();
  markers_.clear();
  if (!task_)
  {
    driven_.clear();
  }
  worker_.setTask(task_);
}

void ViewHoming::setDoesWithoutMatches(bool does)
{
  does_without_matches_ = does;
  needMatches(matches_needed_);
}

void ViewHoming::needMatches(bool needed)
{
  matches_needed_ = needed;
  matches_.setNeeded(needed && !does_without_matches_);
}

BaseVelocity ViewHoming::follow(const Course& course) const
{
  if (!base_in_odom_ || odd_stamps_ > 0)
  {
    return BaseVelocity::Zero();
  }
  Course live = course;
  live.gain *= gain_share_;
  live.turn_gain *= turn_gain_share_;
  return along(live, *base_in_odom_);
}

std::optional<double> ViewHoming::takeLatency()
{
  using Milliseconds = std::chrono::duration<double, std::milli>;
  const std::optional<Clock::time_point> time = std::exchange(unanswered_, std::nullopt);
  return time ? std::make_optional(Milliseconds(Clock::now() - *time).count()) : std::nullopt;
}

void ViewHoming::fill(ServoStatus& status) const
{
  status.translation_error = report_.distance;
  status.rotation_error = std::abs(report_.yaw_error);
  status.point_error = report_.displacement;
  status.inliers = report_.inliers;
}

void ViewHoming::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
{
  status.add("View", points_.view());
  status.add("Inliers", report_.inliers);
  status.add("Odometry delay [s]", odometry_.measuredDelay());
  if (const std::string advice = odometry_.adviceOnDelay(); !advice.empty())
  {
    status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, advice);
  }
}

// ------------------------------------------------------------------------------------------------------------ inputs

void ViewHoming::endIfTimeWentBack(const DriverInput& input)
{
  if (!input.jump().empty())
  {
    context_.abort(input.jump());
    setTask(nullptr);
  }
}

void ViewHoming::endIfStampsAreApart()
{
  // Odometry that has ceased is missing, whatever its last stamp was.
  const std::string apart = odometry_.input().fresh() ? stampsApart(odometry_.input(), images_) : "";
  if (odd_stamps_ >= ODD_STAMPS && !apart.empty())
  {
    context_.abort(apart);
  }
}

void ViewHoming::onFrame(const CameraFrame& frame)
{
  const DriverInput::Stamp place = images_.checkStamp(frame.image->header.stamp);
  endIfTimeWentBack(images_);
  if (place != DriverInput::Stamp::NEWEST)
  {
    return;
  }
  images_.accept();
  call(hooks_.on_frame);
  if (task_ && !sameCalibration(*task_->info, *frame.info))
  {
    context_.abort("the camera's calibration has changed");
    setTask(nullptr);
  }
  odd_stamps_ = stampsApart(odometry_.input(), images_).empty() ? 0 : odd_stamps_ + 1;
  endIfStampsAreApart();
  worker_.addFrame(frame);
}

void ViewHoming::onOdometry(const OdometryInput::Event& event)
{
  const std::optional<OdometryReading> reading = odometry_.read(event);
  endIfTimeWentBack(odometry_.input());
  if (!reading)
  {
    return;
  }
  endIfStampsAreApart();
  worker_.addOdometry(reading->time, reading->pose);
  if (reading->place == DriverInput::Stamp::NEWEST)
  {
    travelled_ += base_in_odom_ ? compose(inverse(*base_in_odom_), reading->pose).distance() : 0.0;
    base_in_odom_ = reading->pose;
    if (task_)
    {
      driven_.add({ reading->pose.x, reading->pose.y, 0.0 });
    }
    call(hooks_.on_odometry);
    if (const std::string fault = motion_.addOdometry(ros::Time::now().toSec(), reading->pose); !fault.empty())
    {
      context_.abort(fault);
    }
  }
}

void ViewHoming::onMatches(bool wanted, const std_msgs::Header& header, const std::vector<PointMatch>& matches)
{
  if (!wanted)
  {
    const std::string& other = points_.otherView().empty() ? lines_.otherView() : points_.otherView();
    matches_.reject(other.empty() ? points_.refusal() + lines_.refusal() : other);
    needMatches(true);
    return;
  }
  matches_.accept();
  worker_.addMatches(header.stamp.toSec(), toHeadingEvidence(matches));
}

void ViewHoming::onOutcome(const HomingOutcome& outcome)
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
  needMatches(!report_.tracked || !matches_.problem().empty());
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
  output_.publish(report_, odometry_.frame(), task_->view);
  const bool ended = report_.state == HomingState::ARRIVED || report_.state == HomingState::FAILED;
  if (ended && !context_.goalRuns())
  {
    setTask(nullptr);  // watched anew with the next image
  }
  call(hooks_.on_image_outcome);
}

void ViewHoming::draw(const HomingOutcome& outcome)
{
  if (!outcome.frame_time || !outcome.fault.empty() || !markers_.wanted())
  {
    return;
  }
  const HomingTask& task = *outcome.task;
  HomingScene scene;
  context_.locked([&] {
    scene.odom_frame = odometry_.frame();
    scene.base = base_in_odom_.value_or(PlanarPose());
    scene.driven = driven_.places();
    if (hooks_.route)
    {
      scene.route = hooks_.route();
    }
  });
  scene.stamp = toStamp(outcome.report.stamp);
  scene.base_frame = base_frame_;
  scene.report = outcome.report;
  scene.course = outcome.course;
  scene.camera = task.camera;
  scene.camera_frame = withoutSlash(task.info->header.frame_id);
  scene.view_camera = task.view_camera;
  scene.base_from_camera = task.base_from_camera;
  scene.landmarks = task.homing->landmarks();
  const visualization_msgs::MarkerArray markers = toMarkers(scene);
  context_.locked([&] {
    if (task_ == outcome.task)  // else it has ended meanwhile, and its markers are deleted
    {
      markers_.publish(markers);
    }
  });
}

}  // namespace view_servo
