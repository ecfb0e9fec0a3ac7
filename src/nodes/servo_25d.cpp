// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/arm_conversions.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/ros/view_answer.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/TwistStamped.h>
#include <ros/publisher.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/JointState.h>
#include <Eigen/Geometry>

#include <chrono>
#include <cmath>
#include <cstddef>
#include <initializer_list>
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
/** One of a goal's views. */
struct ServoStage
{
  std::string view;
  ServoTarget target;
  std::unique_ptr<Servo25d> servo;
};

/** A goal that is ready, then on its way. */
struct ServoTask
{
  sensor_msgs::CameraInfo::ConstPtr info;
  std::vector<ServoStage> stages;  ///< at least one
  std::size_t at = 0;              ///< the stage that the camera is brought to
  int iterations = 0;
  bool unanswered = false;  ///< a homography came, and no command has been sent since
  bool moves = false;       ///< by the last command
  std::string failure;      ///< why it cannot go on

  // Of the stage.
  std::chrono::steady_clock::time_point start;
  bool distance_known = false;                   ///< by the tracker
  bool found = false;                            ///< a valid homography has come
  std::string acquiring = "looks for the view";  ///< why there was none yet

  const ServoStage& stage() const
  {
    return stages[at];
  }
  Servo25d& servo() const
  {
    return *stage().servo;
  }
  bool atLast() const
  {
    return at + 1 == stages.size();
  }
  /** Which of several views this is about, to begin a line with; empty when there is one only. */
  std::string where() const
  {
    return stages.size() == 1 ? ""
                              : "view '" + stage().view + "', " + std::to_string(at + 1) + " of " +
                                    std::to_string(stages.size()) + ": ";
  }
};

/** The goal's views as a list, with its tolerances where a view has none. @throws std::invalid_argument. */
std::vector<ServoView> viewsOf(const ServoToViewGoal& goal)
{
  if (!goal.views.empty() && !goal.view.empty())
  {
    throw std::invalid_argument("the goal has both a view and a list of views: leave one of them empty");
  }
  std::vector<ServoView> views = goal.views;
  if (views.empty())
  {
    views.emplace_back();
    views.back().view = goal.view;
  }
  const auto check = [](std::initializer_list<double> numbers) {
    for (const double number : numbers)
    {
      if (!(number >= 0.0 && std::isfinite(number)))
      {
        throw std::invalid_argument("tolerances, dwell and timeout must be finite and not negative");
      }
    }
  };
  const auto complete = [](double& value, double of_goal) {
    value = value > 0.0 ? value : of_goal;
  };
  check({ goal.translation_tolerance, goal.rotation_tolerance, goal.dwell, goal.timeout });
  for (ServoView& view : views)
  {
    check({ view.translation_tolerance, view.rotation_tolerance, view.dwell });
    complete(view.translation_tolerance, goal.translation_tolerance);
    complete(view.rotation_tolerance, goal.rotation_tolerance);
    complete(view.dwell, goal.dwell);
  }
  return views;
}

}  // namespace

/**
 * Brings the camera in an arm's hand to where a view was stored, by the homographies of a plane (2.5D servoing).
 * Private parameters: see ServoDriverParams.
 *
 * Subscribes:
 *  - `homography` (view_servo/Homography), of homography_tracker, which follows `~wanted_view`;
 *  - `camera_info` (sensor_msgs/CameraInfo): of the same camera. With distortion, P's K counts, as in
 *    homography_tracker;
 *  - `joint_states` (sensor_msgs/JointState), where there are any: a joint at a limit of `robot_description` that does
 *    not come away from it ends a goal. Once they have come, the camera stands still when they cease for
 *    `~joint_timeout`.
 *
 * Publishes, besides what every driver does (see DriverNode):
 *  - `cmd_vel` (geometry_msgs/TwistStamped, the camera's twist in its optical frame), or `cmd_vel_dry`; zero for a
 *    while after each end, then nothing;
 *  - `servo_error` (view_servo/ServoError): after each homography, for plots.
 *
 * Action: `servo` (view_servo/ServoToView). The chosen point is the middle of the view's region. All views of a goal
 * are read before anything moves. Between two of them the camera stands until the tracker has found the next one.
 */
class ServoDriver
{
public:
  using Action = ServoToViewAction;
  using Velocity = Twist;
  using Limiter = TwistLimiter;
  using Task = ServoTask;
  using Params = ServoDriverParams;
  static constexpr const char* ACTION = "servo";

  ServoDriver(DriverContext& context, const Params& params)
    : context_(context),
      params_(params),
      live_(params.servo),
      description_(robotDescription(context.nodeHandle())),
      joints_(jointLimits(description_), params.joint_margin, params.joint_timeout),
      homographies_(context.addInput("homography", context.quoted("homography"), params.homography_timeout)),
      joint_states_(context.addInput("joint states", context.quoted("joint_states"), params.joint_timeout)),
      store_(viewsDir(params.views_dir)),
      answer_("homographies", context.resolved("homography"))
  {
    context.addLive(liveNumbers());
    if (description_.empty())
    {
      ROS_WARN("there is no parameter robot_description: joint limits are not watched");
    }
    ros::NodeHandle& nh = context.nodeHandle();
    command_publisher_ = nh.advertise<geometry_msgs::TwistStamped>(context.commandTopic(), 1);
    error_publisher_ = nh.advertise<ServoError>("servo_error", 5);
    context.listen<Homography>("homography", 5, [this](const Homography::ConstPtr& m) { onHomography(*m); });
    context.listen<sensor_msgs::CameraInfo>("camera_info", 1,
                                            [this](const sensor_msgs::CameraInfo::ConstPtr& m) { onCameraInfo(m); });
    context.listen<sensor_msgs::JointState>("joint_states", 10,
                                            [this](const sensor_msgs::JointState::ConstPtr& m) { onJoints(*m); });
  }

  // -------------------------------------------------------------------------------------------------------- goals

  std::unique_ptr<Task> prepare(const ServoToViewGoal& goal)
  {
    const std::vector<ServoView> views = viewsOf(goal);
    std::vector<StoredView> stored;
    stored.reserve(views.size());
    for (const ServoView& view : views)
    {
      stored.push_back(store_.load(view.view));
    }
    const std::string& first = stored.front().name;
    context_.requestView(first, [&](const std::string& id) { answer_.expect(first, id); });
    // Only one that has come since: the camera may be another than it was.
    context_.locked([this] { info_.reset(); });
    auto task = std::make_unique<Task>();
    context_.waitFor([&] {
      task->info = context_.locked([this] { return info_; });
      return task->info ? "" : "no camera_info has come on " + context_.quoted("camera_info");
    });
    const Camera camera = toCamera(*task->info);
    const std::string fault = faultOf(camera);
    if (!fault.empty())
    {
      throw std::runtime_error(fault);
    }
    for (std::size_t i = 0; i < views.size(); ++i)
    {
      task->stages.push_back(makeStage(stored[i], camera, views[i]));
    }
    context_.waitFor([this] { return context_.locked([this] { return missingAnswer({ &answer_ }); }); });
    return task;
  }

  void begin(std::unique_ptr<Task> task)
  {
    task_ = std::move(task);
    setGains(*task_);  // they may have been changed since it was prepared
    task_->start = Clock::now();
    homographies_.setNeeded(true);
    homographies_.forgetStamps();
    camera_frame_ = withoutSlash(info_->header.frame_id);
    joints_.begin(jointsMoving(description_, camera_frame_));
    joint_states_.setNeeded(false);  // until one of those has been heard of
    onCameraInfo(info_);             // it may have changed since
  }

  void end()
  {
    task_.reset();
    answer_.expect("", "");
  }

  std::string idleView() const
  {
    return "";
  }

  // ------------------------------------------------------------------------------------------------------ control

  Progress progress() const
  {
    Progress progress = progressOfStage();
    progress.reason = task_->where() + progress.reason;
    return progress;
  }

  Velocity wanted(double time)
  {
    ++task_->iterations;
    Velocity twist = task_->servo().command(time);
    task_->moves = !twist.isZero();
    if (!task_->moves)
    {
      joints_.clearStuck();
      return twist;
    }
    // In a dry run no joint follows.
    task_->failure = params_.node.dry_run ? "" : joints_.problem(steadySeconds());
    return task_->failure.empty() ? twist : Velocity(Velocity::Zero());
  }

  void sent(double time, const Velocity& twist)
  {
    if (twist.isZero())
    {
      joints_.clearStuck();
    }
    task_->servo().sent(time, twist);
  }

  void onMissingInput(double time, const std::string& why)
  {
    if (task_->found)
    {
      task_->servo().addLoss(time, why);
    }
  }

  bool hasListener() const
  {
    return command_publisher_.getNumSubscribers() > 0;
  }

  void publish(const Velocity& twist)
  {
    last_twist_.linear = toMessage(twist.head<3>());
    last_twist_.angular = toMessage(twist.tail<3>());
    geometry_msgs::TwistStamped message;
    message.header.stamp = ros::Time::now();
    message.header.frame_id = camera_frame_;
    message.twist = last_twist_;
    command_publisher_.publish(message);
  }

  std::optional<double> takeLatency()
  {
    if (!task_ || !std::exchange(task_->unanswered, false))
    {
      return std::nullopt;
    }
    return 1e3 * (homographies_.age() + last_age_);
  }

  // ----------------------------------------------------------------------------------------------------- messages

  void fill(ServoStatus& status) const
  {
    if (task_)
    {
      const ServoReport& report = task_->servo().report();
      status.translation_error = task_->distance_known ? report.translation_error : NOT_A_NUMBER;
      status.rotation_error = report.rotation_error;
      status.point_error = report.point_error;
      status.inliers = report.inliers;
    }
  }

  void fill(ServoToViewResult& result) const
  {
    if (task_)
    {
      const bool there = task_->servo().report().state == ServoState::CONVERGED;
      result.iterations = task_->iterations;
      result.reached = static_cast<int>(task_->at) + (there ? 1 : 0);
    }
  }

  void fill(ServoToViewFeedback& feedback, const ServoStatus& status) const
  {
    feedback.status = status;
    feedback.view = task_->stage().view;
    feedback.number = static_cast<int>(task_->at) + 1;
    feedback.count = static_cast<int>(task_->stages.size());
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
  {
    status.add("View", answer_.view());
    status.add("Joint limits are watched", joint_states_.fresh() && !params_.node.dry_run);
  }

private:
  using Clock = std::chrono::steady_clock;

  static double steadySeconds()
  {
    return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  }

  /** Why a camera cannot be used; empty when it can. */
  std::string faultOf(const Camera& camera) const
  {
    const std::string fault = camera.fault();
    return fault.empty() ? "" : fault + ", in " + context_.quoted("camera_info");
  }

  ServoStage makeStage(const StoredView& stored, const Camera& camera, const ServoView& wanted) const
  {
    Servo25dParams params = context_.locked([this] { return live_; });
    const auto set = [](double value, double& param) {
      param = value > 0.0 ? value : param;
    };
    set(wanted.translation_tolerance, params.translation_tolerance);
    set(wanted.rotation_tolerance, params.rotation_tolerance);
    set(wanted.dwell, params.dwell);
    const ServoTarget target = servoTargetOf(stored, camera);
    try
    {
      return { stored.name, target, std::make_unique<Servo25d>(target, params) };
    }
    catch (const std::invalid_argument& error)
    {
      throw std::invalid_argument("view '" + stored.name + "': " + error.what());
    }
  }

  /** The parameters that may be changed while the node runs: gains at once, tolerances from the next goal on. */
  LiveGroup liveNumbers()
  {
    Servo25dParams started = params_.servo;
    std::vector<LiveNumber> numbers = aroundNow(parameters(started), { "gain", "near_gain" }, LIVE_GAIN);
    const std::vector<LiveNumber> tolerances =
        aroundNow(parameters(started), { "translation_tolerance", "rotation_tolerance" }, LIVE_TOLERANCE);
    numbers.insert(numbers.end(), tolerances.begin(), tolerances.end());
    return liveGroup<Servo25dParams>(started, numbers, [this](const Servo25dParams& live) {
      context_.locked([&] {
        live_ = live;
        if (task_)
        {
          setGains(*task_);
        }
      });
    });
  }

  /** Gives a goal's views the present gains. */
  void setGains(const Task& task) const
  {
    for (const ServoStage& stage : task.stages)
    {
      stage.servo->setGains(live_.gain, live_.near_gain);
    }
  }

  Progress progressOfStage() const
  {
    if (!task_->failure.empty())
    {
      return { Progress::FAILED, task_->failure };
    }
    if (task_->found)
    {
      return toProgress(task_->servo().report());
    }
    const std::string acquiring = answer_.came() ? task_->acquiring : answer_.missing();
    const bool late = secondsSince(task_->start) > params_.acquire_timeout;
    return late ? Progress{ Progress::FAILED,
                            "the view is not found within " + seconds(params_.acquire_timeout) + ": " + acquiring }
                : Progress{ Progress::ACQUIRING, acquiring };
  }

  /** The camera is at a view that is not the last: the next one is wanted. It stands until the tracker answers. */
  void goOn()
  {
    ROS_INFO_STREAM(task_->where() << task_->servo().report().reason);
    ++task_->at;
    task_->start = Clock::now();
    task_->distance_known = task_->found = task_->moves = false;
    task_->acquiring = "looks for the view";
    joints_.clearStuck();
    answer_.expect(task_->stage().view, context_.goalId());
    context_.requestNextView(task_->stage().view);
    homographies_.setNeeded(false);
  }

  // ------------------------------------------------------------------------------------------------------- inputs

  void onCameraInfo(const sensor_msgs::CameraInfo::ConstPtr& message)
  {
    info_ = message;
    if (task_ && !sameCalibration(*task_->info, *message))
    {
      const std::string fault = faultOf(toCamera(*message));
      context_.abort(fault.empty() ? "the camera's calibration has changed" : fault);
    }
  }

  void onJoints(const sensor_msgs::JointState& message)
  {
    if (!joints_.tells(message.name, message.position))
    {
      return;  // a gripper's, perhaps
    }
    const double now = steadySeconds();
    std::string problem = joints_.add(now, message.name, message.position, message.velocity);
    if (const std::string silent = joints_.silent(now); problem.empty() && !silent.empty())
    {
      problem = "joint '" + silent + "' does not come any more";
    }
    joint_states_.setNeeded(task_ != nullptr);
    problem.empty() ? joint_states_.accept() : joint_states_.reject(problem + " on " + context_.quoted("joint_states"));
  }

  void onHomography(const Homography& message)
  {
    const bool first = !answer_.came();
    if (!answer_.add(message))
    {
      // Of the view before, until the tracker has turned to the next one.
      const bool still = task_ && task_->at > 0 && first && message.view == task_->stages[task_->at - 1].view;
      const std::string& problem = answer_.refusal().empty() ? answer_.otherView() : answer_.refusal();
      if (task_ && !problem.empty() && !still)
      {
        context_.abort(task_->where() + problem);
      }
      return;
    }
    if (!task_)
    {
      return;
    }
    if (first)
    {
      homographies_.setNeeded(true);
      homographies_.restart();
    }
    const std::string topic = "homographies on " + context_.quoted("homography");
    // The tracker may find the view in an image after it has said that it does not.
    const bool corrects = message.valid != 0 && !seen_ && message.header.stamp == homographies_.newestStamp() && !first;
    const DriverInput::Stamp stamp =
        corrects ? DriverInput::Stamp::NEWEST : homographies_.checkStamp(message.header.stamp);
    if (!corrects && !homographies_.jump().empty())
    {
      context_.abort(homographies_.jump());
    }
    if (stamp != DriverInput::Stamp::NEWEST || !task_)
    {
      return;
    }
    seen_ = message.valid != 0;
    const double age = ageOf(message.header.stamp);
    const std::string problem = apply(message, age);
    if (!problem.empty())
    {
      homographies_.reject(topic + " " + problem);
      ROS_WARN_STREAM_THROTTLE(5.0, topic << " " << problem);
      return;
    }
    homographies_.accept();
    task_->unanswered = true;
    last_age_ = age;
    ServoError error =
        toServoError(task_->servo().report(), task_->stage().target, task_->distance_known, message.header);
    error.view = task_->stage().view;
    error.twist = last_twist_;
    error_publisher_.publish(error);
    if (task_->servo().report().state == ServoState::CONVERGED && !task_->atLast())
    {
      goOn();
    }
  }

  /** Takes a homography of the view. @return why it cannot be used; empty: it can. */
  std::string apply(const Homography& message, double age)
  {
    if (!(std::abs(age) <= params_.max_homography_age))
    {
      return age > 0.0 ? "are " + seconds(age) + " old" : "are stamped " + seconds(-age) + " in the future";
    }
    if (message.valid == 0)
    {
      const std::string reason =
          message.reason.empty() ? "the view is not in the image" : oneLine(std::runtime_error(message.reason));
      if (task_->found)
      {
        task_->servo().addLoss(message.header.stamp.toSec(), reason);
      }
      task_->acquiring = reason;
      return "";
    }
    if (message.header.frame_id.empty())
    {
      return "name no camera frame";
    }
    camera_frame_ = withoutSlash(message.header.frame_id);
    try
    {
      const PlaneView view = toPlaneView(message);
      task_->servo().add(view);
      task_->distance_known = task_->distance_known || view.distance;
      task_->found = true;
      return "";
    }
    catch (const std::exception& error)
    {
      return "are not used: " + oneLine(error);
    }
  }

  DriverContext& context_;
  const Params params_;
  Servo25dParams live_;            // with what people have changed since
  const std::string description_;  // URDF; empty: none
  JointGuard joints_;
  DriverInput& homographies_;
  bool seen_ = false;  // the newest homography was valid
  DriverInput& joint_states_;
  const ViewStore store_;
  std::unique_ptr<Task> task_;
  ViewAnswer answer_;
  sensor_msgs::CameraInfo::ConstPtr info_;
  std::string camera_frame_;
  geometry_msgs::Twist last_twist_;
  double last_age_ = 0.0;  // of a homography's image when it came [s]
  ros::Publisher command_publisher_;
  ros::Publisher error_publisher_;
};

const NodeType SERVO_25D = driverType<DriverNode<ServoDriver>>("servo_25d");

}  // namespace view_servo
