// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/servo_25d.h"
#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/SetView.h"
#include "view_servo/control/input_watch.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/servo_parameters.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/rectifier.h"
#include "view_servo/views/view_store.h"

#include <actionlib/server/simple_action_server.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/service.h>
#include <ros/subscriber.h>
#include <ros/transport_hints.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <urdf_parser/urdf_parser.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

struct Params
{
  std::filesystem::path views_dir;
  std::string homography_tracker = "homography_tracker";
  double timeout = 60.0;
  double acquire_timeout = 15.0;
  double control_rate = 50.0;
  double homography_timeout = 0.25;
  double max_homography_age = 0.5;
  double joint_margin = 0.02;
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;

  static Params read(ParameterReader& reader)
  {
    Params params;
    params.views_dir = readViewsDir(reader);
    reader.read("homography_tracker", params.homography_tracker);
    reader.read("timeout", params.timeout);
    reader.read("acquire_timeout", params.acquire_timeout);
    reader.require(params.timeout > 0.0 && params.acquire_timeout > 0.0,
                   "~timeout and ~acquire_timeout must be more than 0 s");
    reader.read("control_rate", params.control_rate);
    reader.require(params.control_rate >= 10.0 && params.control_rate <= 1000.0,
                   "~control_rate must lie in [10, 1000] Hz");
    reader.read("homography_timeout", params.homography_timeout);
    reader.read("max_homography_age", params.max_homography_age);
    reader.require(params.homography_timeout > 0.0 && params.max_homography_age > 0.0,
                   "~homography_timeout and ~max_homography_age must be more than 0 s");
    reader.read("joint_margin", params.joint_margin);
    reader.require(params.joint_margin >= 0.0, "~joint_margin must not be negative");
    reader.read(servoParameters(params.servo, params.limits));
    reader.addFaults(params.servo.validate());
    reader.addFaults(params.limits.validate());
    reader.finish();
    return params;
  }
};

/** The limits of a URDF's joints; none when it is empty or cannot be read. */
std::map<std::string, JointLimits> jointLimits(const std::string& description)
{
  std::map<std::string, JointLimits> limits;
  if (description.empty())
  {
    return limits;
  }
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(description);
  if (!model)
  {
    ROS_WARN("robot_description is no URDF: joint limits are not watched");
    return limits;
  }
  for (const auto& [name, joint] : model->joints_)
  {
    if (joint->limits && (joint->type == urdf::Joint::REVOLUTE || joint->type == urdf::Joint::PRISMATIC))
    {
      limits[name] = { joint->limits->lower, joint->limits->upper };
    }
  }
  return limits;
}

/** What a homography says. @throws std::runtime_error when its numbers make no sense. */
PlaneView toPlaneView(const Homography& message)
{
  constexpr double TOLERANCE = 0.01;
  const Eigen::Quaterniond rotation(message.rotation.w, message.rotation.x, message.rotation.y, message.rotation.z);
  PlaneView view;
  view.stamp = message.header.stamp.toSec();
  view.inliers = message.inliers;
  view.motion.rotation = rotation.normalized().toRotationMatrix();
  view.motion.translation_over_distance = toVector(message.translation_over_distance);
  view.motion.normal = toVector(message.normal);
  if (std::isnan(message.normal.z))
  {
    view.motion.normal = Eigen::Vector3d::UnitZ();  // not known yet; the tracker takes the same
  }
  if (!std::isnan(message.distance))
  {
    view.distance = message.distance;
  }
  const bool sane = std::abs(rotation.norm() - 1.0) < TOLERANCE && view.motion.translation_over_distance.allFinite() &&
                    std::abs(view.motion.normal.norm() - 1.0) < TOLERANCE &&
                    (!view.distance || (*view.distance > 0.0 && std::isfinite(*view.distance)));
  if (!sane)
  {
    throw std::runtime_error("its rotation, translation, normal or distance is not one");
  }
  return view;
}

std::uint8_t toStatusState(ServoState state)
{
  switch (state)
  {
    case ServoState::ACQUIRING:
      return ServoStatus::ACQUIRING;
    case ServoState::LOST:
      return ServoStatus::LOST;
    case ServoState::CONVERGED:
      return ServoStatus::CONVERGED;
    case ServoState::FAILED:
      return ServoStatus::ABORTED;
    default:
      return ServoStatus::SERVOING;
  }
}

/** A goal on its way. */
struct Session
{
  Session(const Rectifier& camera_rectifier, const ServoTarget& servo_target, const Servo25dParams& params)
    : rectifier(camera_rectifier), target(servo_target), servo(target, params)
  {
  }

  std::string view;
  double timeout = 0.0;  ///< [s]
  Rectifier rectifier;
  ServoTarget target;
  Servo25d servo;
  std::string camera_frame;                      ///< of the calibration, then of the last homography
  bool distance_known = false;                   ///< by the tracker
  bool seen = false;                             ///< a homography message of the view has come
  bool found = false;                            ///< ... and one that is valid
  std::string acquiring = "looks for the view";  ///< why there was none yet
  bool news = false;                             ///< one that no command has followed yet
  std::string problem;                           ///< why the last homography was not used
  InputWatch::Clock::time_point start = InputWatch::Clock::now();
  int iterations = 0;
};

}  // namespace

/**
 * Brings the camera in an arm's hand to where a view was stored, by the homographies of a plane (2.5D servoing). Parameters,
 * all private; config/servo_25d.yaml has them with their ranges:
 *  - `~views_dir` (string): as in view_store;
 *  - `~homography_tracker` (string, default "homography_tracker"): node whose `~start` and `~stop` are called; "": none;
 *  - `~dry_run` (bool, default false): see CommandGate;
 *  - `~timeout` (double, default 60 [s]); `~acquire_timeout` (double, default 15 [s]): until the view is found at first;
 *  - `~control_rate` (double, default 50 [Hz]);
 *  - `~homography_timeout` (double, default 0.25 [s]): without a homography for so long, by a steady clock, the camera stands
 *    still until there is one again; `~max_homography_age` (double, default 0.5 [s]): older ones do not count;
 *  - `~joint_margin` (double, default 0.02 [rad] or [m]): see below;
 *  - those of servoing and of the camera's limits, see servoParameters().
 *
 * Subscribes:
 *  - `homography` (view_servo/Homography), of homography_tracker;
 *  - `camera_info` (sensor_msgs/CameraInfo): of the same camera. With distortion, P's K counts, as in homography_tracker;
 *  - `joint_states` (sensor_msgs/JointState), where there are any: a joint at a limit of `robot_description` that does not
 *    come away from it ends a goal.
 *
 * Publishes:
 *  - `cmd_vel` (geometry_msgs/TwistStamped, the camera's twist in its optical frame), or `cmd_vel_dry`; zero for a while
 *    after each end, then nothing;
 *  - `status` (view_servo/ServoStatus), latched;
 *  - `servo_error` (view_servo/ServoError): after each homography, for plots;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, servoing.
 *
 * Services: `~enable` (std_srvs/SetBool): off at start; switching it off ends a goal.
 * Actions: `servo` (view_servo/ServoToView). The chosen point is the middle of the view's region.
 *
 * The tracker is told by a thread of the node's own: the timer that sends commands waits for nobody, so that what stops the
 * camera does so within a cycle. In a dry run nobody follows what is sent, so it is not taken into account.
 */
class Servo25dNode : private NodeBase
{
public:
  Servo25dNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : Servo25dNode(nh, private_nh, ParameterReader(private_nh))
  {
  }

  ~Servo25dNode()
  {
    {
      const std::lock_guard<std::mutex> lock(goal_mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    goal_thread_.join();
  }

  /** Sends zero, for good. */
  void stop()
  {
    control_timer_.stop();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (session_)
    {
      finish(false, "the node is shutting down");
    }
    send(Twist::Zero());
  }

private:
  using Clock = InputWatch::Clock;
  using ActionServer = actionlib::SimpleActionServer<ServoToViewAction>;

  Servo25dNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, ParameterReader reader)
    : NodeBase(nh, private_nh),
      gate_(reader),
      params_(Params::read(reader)),
      limiter_(params_.limits),
      joints_(jointLimits(nh_.param<std::string>("robot_description", "")), params_.joint_margin),
      homography_watch_(params_.homography_timeout),
      store_(params_.views_dir),
      status_(nh_),
      action_(nh_, "servo", false)
  {
    command_publisher_ = nh_.advertise<geometry_msgs::TwistStamped>(gate_.dryRun() ? "cmd_vel_dry" : "cmd_vel", 1);
    error_publisher_ = nh_.advertise<ServoError>("servo_error", 5);
    enable_service_ = serve("enable", &Servo25dNode::enable, this);
    diagnostics_.add("servoing", this, &Servo25dNode::diagnose);
    const auto hints = ros::TransportHints().tcpNoDelay();
    homography_subscriber_ = nh_.subscribe("homography", 5, &Servo25dNode::takeHomography, this, hints);
    info_subscriber_ = nh_.subscribe("camera_info", 1, &Servo25dNode::takeInfo, this);
    joints_subscriber_ = nh_.subscribe("joint_states", 10, &Servo25dNode::takeJoints, this, hints);
    status_.publish(idleStatus(gate_));
    goal_thread_ = std::thread([this] { takeGoals(); });
    // Called with the action server's lock held, so that mutex_, under which action_ is called, must not be taken here.
    action_.registerGoalCallback([this] {
      {
        const std::lock_guard<std::mutex> lock(goal_mutex_);
        goal_pending_ = true;
      }
      wake_.notify_all();
    });
    action_.start();
    control_timer_ = nh_.createWallTimer(ros::WallDuration(1.0 / params_.control_rate),
                                         [this](const ros::WallTimerEvent&) { control(); });
  }

  // ------------------------------------------------------------------------------------------------------- inputs

  void takeInfo(const sensor_msgs::CameraInfo::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    info_ = message;
    if (session_ && !session_->rectifier.isOf(*message))
    {
      end(isCalibrated(*message) ? "the camera's calibration has changed" : uncalibrated());
    }
  }

  void takeJoints(const sensor_msgs::JointState::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    joints_.add(message->header.stamp.toSec(), message->name, message->position, message->velocity);
    ++joint_messages_;
  }

  void takeHomography(const Homography::ConstPtr& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string jump = timeJump(last_stamp_, message->header.stamp, "homographies");
    if (!session_)
    {
      return;
    }
    if (!jump.empty())
    {
      end(jump);
      return;
    }
    Session& session = *session_;
    const std::string topic = "'" + homography_subscriber_.getTopic() + "'";
    if (message->view != session.view)
    {
      session.problem =
          "homographies on " + topic + " are of view '" + message->view + "', not of '" + session.view + "'";
      if (session.seen)  // else they may be the last ones of what was followed before
      {
        end(session.problem);
      }
      return;
    }
    session.seen = true;
    const double age = (ros::Time::now() - message->header.stamp).toSec();
    if (!(std::abs(age) <= params_.max_homography_age))
    {
      session.problem = "homographies on " + topic + " are " + seconds(age) + " old";
      return;
    }
    if (message->header.frame_id.empty())
    {
      session.problem = "homographies on " + topic + " name no camera frame";
      return;
    }
    session.camera_frame = message->header.frame_id;
    try
    {
      heed(session, *message);
    }
    catch (const std::exception& error)
    {
      session.problem = "a homography on " + topic + " is not used: " + oneLine(error);
      ROS_WARN_STREAM_THROTTLE(5.0, session.problem);
      return;
    }
    session.problem.clear();
    session.news = true;
    homography_watch_.feed();
    publishError(session, message->header);
  }

  static void heed(Session& session, const Homography& message)
  {
    if (message.valid == 0)
    {
      const std::string reason = message.reason.empty() ? "the view is not in the image" : message.reason;
      if (session.found)
      {
        session.servo.addLoss(message.header.stamp.toSec(), reason);
      }
      else
      {
        session.acquiring = reason;
      }
      return;
    }
    const PlaneView view = toPlaneView(message);
    session.found = true;
    session.distance_known = session.distance_known || view.distance;
    session.servo.add(view);
  }

  // -------------------------------------------------------------------------------------------------------- goals

  void enable(const std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response)
  {
    response = gate_.set(request.data != 0);
  }

  void takeGoals()
  {
    std::unique_lock<std::mutex> lock(goal_mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || goal_pending_ || tracker_waits_; });
      if (std::exchange(goal_pending_, false))
      {
        lock.unlock();
        takeGoal();
        lock.lock();
      }
      else if (std::exchange(tracker_waits_, false))
      {
        lock.unlock();
        stopTracker();
        lock.lock();
      }
    }
  }

  /** A new goal; if one is active, it is replaced. */
  void takeGoal()
  {
    ServoToViewGoal goal;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (session_)
      {
        finish(false, "another goal has come");
      }
      if (!action_.isNewGoalAvailable())
      {
        return;  // cancelled before it was taken
      }
      goal = *action_.acceptNewGoal();
    }
    std::unique_ptr<Session> session;
    std::string refusal;
    try
    {
      session = makeSession(goal);
    }
    catch (const std::exception& error)
    {
      refusal = oneLine(error);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (session)
    {
      session_ = std::move(session);
      session_->start = Clock::now();
      limiter_.stop();
      joints_.rest();
      homography_watch_.feed();
      return;
    }
    ServoToViewResult result;
    result.message = refusal;
    result.final = makeStatus(gate_.open() ? ServoStatus::ABORTED : ServoStatus::DISABLED, refusal);
    status_.publish(result.final);
    action_.setAborted(result, refusal);
  }

  /** @throws std::exception saying what is missing. */
  std::unique_ptr<Session> makeSession(const ServoToViewGoal& goal)
  {
    if (!gate_.open())
    {
      throw std::runtime_error("servoing is disabled: call ~enable first");
    }
    for (const double value : { goal.translation_tolerance, goal.rotation_tolerance, goal.dwell, goal.timeout })
    {
      if (!(value >= 0.0 && std::isfinite(value)))
      {
        throw std::invalid_argument("tolerances, dwell and timeout must be finite and not negative");
      }
    }
    if (!soon([this] { return heard(); }))
    {
      throw std::runtime_error("nobody listens on '" + command_publisher_.getTopic() + "'");
    }
    sensor_msgs::CameraInfo::ConstPtr info;
    const auto has_come = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      info = info_;
      return info != nullptr;
    };
    if (!soon(has_come))
    {
      throw std::runtime_error("no camera_info has come on '" + info_subscriber_.getTopic() + "'");
    }
    if (!isCalibrated(*info))
    {
      throw std::runtime_error(uncalibrated());
    }
    const StoredView stored = store_.load(goal.view);
    const Rectifier rectifier(*info);
    const cv::Size size = rectifier.size();
    if (stored.image.size() != size)
    {
      throw std::runtime_error("view '" + stored.name + "' has " + std::to_string(stored.image.cols) + " x " +
                               std::to_string(stored.image.rows) + " pixels, the camera " + std::to_string(size.width) +
                               " x " + std::to_string(size.height));
    }
    const cv::Rect region = stored.region.empty() ? cv::Rect(cv::Point(), size) : stored.region;
    const Eigen::Vector2d middle(region.x + 0.5 * (region.width - 1), region.y + 0.5 * (region.height - 1));
    Servo25dParams params = params_.servo;
    const auto set = [](double wanted, double& value) {
      value = wanted > 0.0 ? wanted : value;
    };
    set(goal.translation_tolerance, params.translation_tolerance);
    set(goal.rotation_tolerance, params.rotation_tolerance);
    set(goal.dwell, params.dwell);
    auto session = std::make_unique<Session>(
        rectifier, ServoTarget{ rectifier.k(), { size.width, size.height }, rectifier.point(middle) }, params);
    session->view = stored.name;
    session->camera_frame = info->header.frame_id;
    session->timeout = params_.timeout;
    set(goal.timeout, session->timeout);
    startTracker(stored.name);
    return session;
  }

  /** Whether something holds, or comes to within a while: just after a launch, connections take a moment. */
  static bool soon(const std::function<bool()>& holds)
  {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(2.0);
    while (!holds())
    {
      if (ros::WallTime::now() >= deadline)
      {
        return false;
      }
      ros::WallDuration(0.02).sleep();
    }
    return true;
  }

  /** Whether somebody follows commands, or nobody needs to. */
  bool heard() const
  {
    return gate_.dryRun() || command_publisher_.getNumSubscribers() > 0;
  }

  std::string uncalibrated() const
  {
    return "the camera is not calibrated: K is all zero in '" + info_subscriber_.getTopic() + "'";
  }

  void startTracker(const std::string& view)
  {
    if (params_.homography_tracker.empty())
    {
      return;
    }
    const std::string service = nh_.resolveName(params_.homography_tracker + "/start");
    SetView call;
    call.request.view = view;
    if (!ros::service::exists(service, false))
    {
      throw std::runtime_error("there is no " + service);
    }
    if (!ros::service::call(service, call) || call.response.success == 0)
    {
      throw std::runtime_error(service + " refused the view: " + call.response.message);
    }
    const std::lock_guard<std::mutex> lock(goal_mutex_);
    tracker_waits_ = false;
  }

  void stopTracker()
  {
    const std::string service = nh_.resolveName(params_.homography_tracker + "/stop");
    std_srvs::Trigger call;
    if (!params_.homography_tracker.empty() && ros::service::exists(service, false) &&
        !ros::service::call(service, call))
    {
      ROS_WARN_STREAM(service << " does not answer");
    }
  }

  /** Ends the goal without success. The mutex is held. */
  void end(const std::string& reason)
  {
    finish(false, reason);
  }

  /**
   * Stops, then ends the goal and publishes why. The reason is a copy: it may be part of the session, which ends here. The
   * mutex is held.
   */
  void finish(bool success, const std::string reason)  // NOLINT(performance-unnecessary-value-param)
  {
    rest();
    ServoToViewResult result;
    result.success = success ? 1 : 0;
    result.message = reason;
    result.iterations = session_->iterations;
    result.duration = std::chrono::duration<double>(Clock::now() - session_->start).count();
    const auto state = success ? ServoStatus::CONVERGED : gate_.open() ? ServoStatus::ABORTED : ServoStatus::DISABLED;
    result.final = toStatus(state, reason);
    session_.reset();
    status_.publish(result.final);
    {
      const std::lock_guard<std::mutex> lock(goal_mutex_);
      tracker_waits_ = true;
    }
    wake_.notify_all();
    if (success)
    {
      action_.setSucceeded(result, reason);
    }
    else if (action_.isPreemptRequested())
    {
      action_.setPreempted(result, reason);
    }
    else
    {
      action_.setAborted(result, reason);
    }
  }

  // ------------------------------------------------------------------------------------------------------ control

  void control()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ros::Time now = ros::Time::now();
    const std::string jump = timeJump(last_now_, now, "the clock");
    if (!session_)
    {
      idle();
      return;
    }
    const ServoReport& report = session_->servo.report();
    const double elapsed = std::chrono::duration<double>(Clock::now() - session_->start).count();
    if (!jump.empty())
    {
      end(jump);
    }
    else if (!gate_.open())
    {
      end("disabled");
    }
    else if (action_.isPreemptRequested())
    {
      end("the goal was cancelled");
    }
    else if (report.state == ServoState::CONVERGED)
    {
      finish(true, report.reason);
    }
    else if (report.state == ServoState::FAILED)
    {
      end(report.reason);
    }
    else if (!session_->found && elapsed > params_.acquire_timeout)
    {
      end("the view is not found within " + seconds(params_.acquire_timeout) + ": " + session_->acquiring);
    }
    else if (elapsed > session_->timeout)
    {
      end("not at the view within " + seconds(session_->timeout) + ": " +
          (session_->found ? report.reason : session_->acquiring));
    }
    else if (!heard())
    {
      end("nobody listens any more on '" + command_publisher_.getTopic() + "'");
    }
    else if (homography_watch_.stale())
    {
      waitForHomography(now);
    }
    else
    {
      drive(now);
    }
  }

  void drive(const ros::Time& now)
  {
    inputs_missing_since_.reset();
    Session& session = *session_;
    const Twist wanted = session.servo.command(now.toSec());
    if (wanted.isZero())
    {
      limiter_.stop();
      joints_.rest();
    }
    else
    {
      const std::string problem = joints_.problem(now.toSec());
      if (!problem.empty())
      {
        end(problem);
        return;
      }
    }
    const Twist twist = limiter_.next(wanted, 1.0 / params_.control_rate);
    if (!gate_.dryRun())
    {
      session.servo.sent(now.toSec(), twist);
    }
    send(twist);
    ++session.iterations;
    const ServoStatus status = toStatus(toStatusState(session.servo.report().state), reason());
    status_.publish(status);
    if (std::exchange(session.news, false))
    {
      const double ms = 1e3 * homography_watch_.age() + 1e3 * last_age_;
      cycles_ += 1;
      cycle_sum_ += ms;
      cycle_max_ = std::max(cycle_max_, ms);
      ServoToViewFeedback feedback;
      feedback.status = status;
      action_.publishFeedback(feedback);
    }
  }

  /** One that stays the same while numbers change: status is told, and logged, when it does not. */
  std::string reason() const
  {
    const ServoReport& report = session_->servo.report();
    return !session_->found                       ? session_->acquiring
           : report.state == ServoState::SERVOING ? "drives to the view"
                                                  : report.reason;
  }

  void waitForHomography(const ros::Time& now)
  {
    const std::string missing = session_->problem.empty()
                                    ? "no homography for " + seconds(homography_watch_.timeout()) + " on '" +
                                          homography_subscriber_.getTopic() + "'"
                                    : session_->problem;
    rest();
    if (session_->found)
    {
      session_->servo.addLoss(now.toSec(), missing);
    }
    if (!inputs_missing_since_)
    {
      inputs_missing_since_ = Clock::now();
    }
    // By a steady clock, also when that of the images stands still.
    if (std::chrono::duration<double>(Clock::now() - *inputs_missing_since_).count() > params_.servo.lost_timeout)
    {
      finish(false, missing);
      return;
    }
    if (!gate_.dryRun())
    {
      session_->servo.sent(now.toSec(), Twist::Zero());
    }
    status_.publish(toStatus(ServoStatus::LOST, missing));
  }

  /** Zero at once. */
  void rest()
  {
    limiter_.stop();
    joints_.rest();
    send(Twist::Zero());
  }

  /** Without a goal: zero for a while, then silence. */
  void idle()
  {
    inputs_missing_since_.reset();
    if (zeros_.due())
    {
      send(Twist::Zero());
    }
    if (isOutdated(status_.last(), gate_))
    {
      status_.publish(idleStatus(gate_));
    }
  }

  void send(const Twist& twist)
  {
    zeros_.sent(twist.isZero());
    last_twist_.linear = toMessage(twist.head<3>());
    last_twist_.angular = toMessage(twist.tail<3>());
    if (session_ && !session_->camera_frame.empty())
    {
      camera_frame_ = session_->camera_frame;
    }
    geometry_msgs::TwistStamped message;
    message.header.stamp = ros::Time::now();
    message.header.frame_id = camera_frame_;
    message.twist = last_twist_;
    command_publisher_.publish(message);
  }

  // ------------------------------------------------------------------------------------------------------ messages

  ServoStatus toStatus(std::uint8_t state, const std::string& reason) const
  {
    const ServoReport& report = session_->servo.report();
    ServoStatus status = makeStatus(state, reason);
    status.translation_error = session_->distance_known ? report.translation_error : NOT_A_NUMBER;
    status.rotation_error = report.rotation_error;
    status.point_error = report.point_error;
    status.inliers = report.inliers;
    return status;
  }

  void publishError(const Session& session, const std_msgs::Header& header)
  {
    const ServoReport& report = session.servo.report();
    last_age_ = (ros::Time::now() - header.stamp).toSec();
    ServoError message;
    message.header = header;
    message.view = session.view;
    message.state = toStatusState(report.state);
    const bool known = report.error && (report.state == ServoState::SERVOING || report.state == ServoState::CONVERGED);
    const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(NOT_A_NUMBER);
    message.point_x = known ? report.point.x() : NOT_A_NUMBER;
    message.point_y = known ? report.point.y() : NOT_A_NUMBER;
    message.wanted_x = session.target.point.x();
    message.wanted_y = session.target.point.y();
    message.error_x = known ? report.error->point.x() : NOT_A_NUMBER;
    message.error_y = known ? report.error->point.y() : NOT_A_NUMBER;
    message.log_depth = known ? report.error->depth : NOT_A_NUMBER;
    message.rotation = toMessage(known ? report.error->rotation : unknown);
    message.gain_x = known ? report.gains.x() : NOT_A_NUMBER;
    message.gain_y = known ? report.gains.y() : NOT_A_NUMBER;
    message.translation_error = known && session.distance_known ? report.translation_error : NOT_A_NUMBER;
    message.rotation_error = known ? report.rotation_error : NOT_A_NUMBER;
    message.twist = last_twist_;
    error_publisher_.publish(message);
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ServoStatus& last = status_.last();
    const bool worrying = last.state == ServoStatus::LOST || last.state == ServoStatus::ABORTED;
    status.summary(worrying ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   last.reason);
    status.add("View", session_ ? session_->view : "");
    status.add("Enabled", gate_.enabled());
    status.add("Dry run", gate_.dryRun());
    status.add("Joint limits are watched", !joints_.empty() && joint_messages_ > 0);
    status.add("Image to command, mean [ms]", cycles_ > 0 ? cycle_sum_ / cycles_ : NOT_A_NUMBER);
    status.add("Image to command, largest [ms]", cycles_ > 0 ? cycle_max_ : NOT_A_NUMBER);
    status.add("Homography, age [s]", homography_watch_.age());
    cycles_ = 0;
    cycle_sum_ = cycle_max_ = 0.0;
  }

  CommandGate gate_;
  const Params params_;

  std::mutex mutex_;  // guards what follows; taken before goal_mutex_ and the action server's lock
  TwistLimiter limiter_;
  JointGuard joints_;
  std::unique_ptr<Session> session_;
  sensor_msgs::CameraInfo::ConstPtr info_;
  std::optional<Clock::time_point> inputs_missing_since_;
  ros::Time last_now_;
  ros::Time last_stamp_;
  std::string camera_frame_;
  geometry_msgs::Twist last_twist_;
  double last_age_ = 0.0;  // of a homography's image when it came [s]
  Zeros zeros_;
  int joint_messages_ = 0;
  int cycles_ = 0;          // of homographies that commands have followed, since the last diagnosis
  double cycle_sum_ = 0.0;  // [ms]
  double cycle_max_ = 0.0;

  std::mutex goal_mutex_;  // guards what follows; nothing is called while it is held
  std::condition_variable wake_;
  bool goal_pending_ = false;
  bool tracker_waits_ = false;  // for being stopped
  bool stopping_ = false;

  InputWatch homography_watch_;
  const ViewStore store_;
  ros::Publisher command_publisher_;
  ros::Publisher error_publisher_;
  StatusOutput status_;
  ros::ServiceServer enable_service_;
  ros::Subscriber homography_subscriber_;
  ros::Subscriber info_subscriber_;
  ros::Subscriber joints_subscriber_;
  ActionServer action_;
  std::thread goal_thread_;
  ros::WallTimer control_timer_;
};

}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runControlNode<view_servo::Servo25dNode>(argc, argv, "servo_25d");
}
