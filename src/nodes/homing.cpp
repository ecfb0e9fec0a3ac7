// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing.h"
#include "view_servo/Heading.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"
#include "view_servo/control/homing_parameters.h"
#include "view_servo/control/input_watch.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/views/view_store.h"

#include <actionlib/server/simple_action_server.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/service.h>
#include <ros/subscriber.h>
#include <ros/transport_hints.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

struct Params
{
  CameraInputParams camera;
  std::filesystem::path views_dir;
  std::string view;
  std::string base_frame = "base_link";
  std::string point_matcher = "point_matcher";
  std::string line_matcher = "line_matcher";
  double timeout = 120.0;
  double control_rate = 50.0;
  double image_timeout = 0.25;
  double odometry_timeout = 0.25;
  double match_timeout = 0.25;
  HomingParams homing;
  VelocityLimits limits;

  void read(ParameterReader& reader)
  {
    camera = CameraInputParams::read(reader);
    views_dir = readViewsDir(reader);
    reader.read("view", view);
    reader.require(view.empty() || isValidViewName(view), "~view: '" + view + "' is not a view's name");
    reader.read("base_frame", base_frame);
    reader.require(!base_frame.empty(), "~base_frame must not be empty");
    reader.read("point_matcher", point_matcher);
    reader.read("line_matcher", line_matcher);
    reader.read("timeout", timeout);
    reader.require(timeout > 0.0, "~timeout must be more than 0 s");
    reader.read("control_rate", control_rate);
    reader.require(control_rate >= 10.0 && control_rate <= 1000.0, "~control_rate must lie in [10, 1000] Hz");
    reader.read("image_timeout", image_timeout);
    reader.read("odometry_timeout", odometry_timeout);
    reader.read("match_timeout", match_timeout);
    reader.require(image_timeout > 0.0 && odometry_timeout > 0.0 && match_timeout > 0.0,
                   "~image_timeout, ~odometry_timeout and ~match_timeout must be more than 0 s");
    reader.read(homingParameters(homing, limits));
    reader.addFaults(homing.validate());
    reader.addFaults(limits.validate());
  }
};

/** Matches as homing takes them, whoever found them. */
struct MatchesInput
{
  double stamp;
  Correspondences pairs;
  std::vector<double> weights;
};

MatchesInput toInput(const std_msgs::Header& header, const std::vector<PointMatch>& matches)
{
  MatchesInput input{ header.stamp.toSec(), {}, {} };
  for (const PointMatch& match : matches)
  {
    input.pairs.push_back({ { match.reference_x, match.reference_y }, { match.current_x, match.current_y } });
    input.weights.push_back(match.score);
  }
  return input;
}

std::uint8_t toHeadingState(const HomingReport& report)
{
  if (report.at_view)
  {
    return Heading::ARRIVED;
  }
  switch (report.state)
  {
    case HomingState::NEAR:
      return Heading::NEAR;
    case HomingState::DOCKING:
    case HomingState::ARRIVED:
      return Heading::DOCKING;
    case HomingState::LOST:
    case HomingState::FAILED:
      return Heading::LOST;
    default:
      return Heading::APPROACHING;
  }
}

/** An attempt to reach a view, or, without a goal, the watch for its direction. */
struct Session
{
  std::string view;
  bool has_goal = false;
  double timeout = 0.0;  ///< [s]
  InputWatch::Clock::time_point start = InputWatch::Clock::now();

  std::mutex mutex;  ///< guards homing: taking an image lasts longer than a cycle of control
  std::unique_ptr<Homing> homing;
};

}  // namespace

/**
 * Drives a holonomic mobile base back to where a view was stored. Parameters, all private; config/homing.yaml has them
 * with their ranges:
 *  - `~view` (string, default ""): stored view whose direction is estimated while there is no goal, and which a goal
 *    without a name means;
 *  - `~views_dir` (string): as in view_store;
 *  - `~base_frame` (string, default "base_link"), which tf must know the camera's frame in;
 *  - `~point_matcher`, `~line_matcher` (string, default their names): nodes whose `~set_view` is called with a goal's view;
 *  - `~dry_run` (bool, default false): see CommandGate;
 *  - `~timeout` (double, default 120 [s]), `~control_rate` (double, default 50 [Hz]);
 *  - `~image_timeout`, `~odometry_timeout`, `~match_timeout` (double, default 0.25 [s]): without input for so long, by a
 *    steady clock, the base stands still until there is some again;
 *  - `~image_transport`, `~queue_size`, `~max_image_age`: see CameraInput;
 *  - those of homing and of the base's limits, see homingParameters().
 *
 * Subscribes:
 *  - `image_raw`, `camera_info`: see CameraInput;
 *  - `point_matches` (view_servo/PointMatches), `line_matches` (view_servo/LineMatches): either may be silent;
 *  - `odom` (nav_msgs/Odometry), of `~base_frame`; tf.
 *
 * Publishes:
 *  - `cmd_vel` (geometry_msgs/Twist, in base_link) and `cmd_vel_stamped`, or `cmd_vel_dry` and `cmd_vel_dry_stamped`; zero
 *    for a while after each end, then nothing;
 *  - `heading` (view_servo/Heading): for each image; `heading_arrow` (geometry_msgs/PoseStamped): the same for rviz, at
 *    the base, its x axis towards the view, while there is a heading;
 *  - `status` (view_servo/ServoStatus), latched;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and homing.
 *
 * Services: `~enable` (std_srvs/SetBool): off at start; switching it off ends a goal.
 * Actions: `home` (view_servo/HomeToView).
 *
 * Images and matches are worked on by a thread of the node's own. The timer that sends commands never waits for it, so
 * that what stops the base does so within a cycle.
 */
class HomingNode : private NodeBase
{
public:
  HomingNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : HomingNode(nh, private_nh, ParameterReader(private_nh))
  {
  }

  ~HomingNode()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    worker_.join();
  }

  /** Sends zero, for good. */
  void stop()
  {
    control_timer_.stop();
    const std::lock_guard<std::mutex> lock(control_mutex_);
    if (goalIsActive())
    {
      finish(false, "the node is shutting down");
    }
    send(BaseVelocity::Zero());
  }

private:
  using Clock = InputWatch::Clock;
  using ActionServer = actionlib::SimpleActionServer<HomeToViewAction>;

  HomingNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, ParameterReader reader)
    : NodeBase(nh, private_nh),
      gate_(reader),
      params_(readParams(reader)),
      limiter_(params_.limits),
      image_watch_(params_.image_timeout),
      odometry_watch_(params_.odometry_timeout),
      match_watch_(params_.match_timeout),
      store_(params_.views_dir),
      transforms_(tf_buffer_),
      status_(nh_),
      camera_(nh, params_.camera, [this](const CameraFrame& frame) { takeFrame(frame); }),
      action_(nh_, "home", false)
  {
    const std::string name = gate_.dryRun() ? "cmd_vel_dry" : "cmd_vel";
    command_publisher_ = nh_.advertise<geometry_msgs::Twist>(name, 1);
    stamped_publisher_ = nh_.advertise<geometry_msgs::TwistStamped>(name + "_stamped", 1);
    heading_publisher_ = nh_.advertise<Heading>("heading", 5);
    arrow_publisher_ = nh_.advertise<geometry_msgs::PoseStamped>("heading_arrow", 5);
    enable_service_ = serve("enable", &HomingNode::enable, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("homing", this, &HomingNode::diagnose);
    const auto hints = ros::TransportHints().tcpNoDelay();
    odometry_subscriber_ = nh_.subscribe("odom", 50, &HomingNode::takeOdometry, this, hints);
    points_subscriber_ = nh_.subscribe("point_matches", 1, &HomingNode::takePoints, this, hints);
    lines_subscriber_ = nh_.subscribe("line_matches", 1, &HomingNode::takeLines, this, hints);
    status_.publish(idleStatus(gate_));
    worker_ = std::thread([this] { work(); });
    // Called with the action server's lock held, so that mutex_ must never be held where action_ is called.
    action_.registerGoalCallback([this] {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        goal_pending_ = true;
      }
      wake_.notify_all();
    });
    action_.start();
    control_timer_ = nh_.createWallTimer(ros::WallDuration(1.0 / params_.control_rate),
                                         [this](const ros::WallTimerEvent&) { control(); });
  }

  static Params readParams(ParameterReader& reader)
  {
    Params params;
    params.read(reader);
    reader.finish();
    return params;
  }

  // ------------------------------------------------------------------------------------------------------ inputs

  void takeFrame(const CameraFrame& frame)
  {
    image_watch_.feed();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      checkTime(last_image_stamp_, frame.image->header.stamp, "images");
      newest_frame_ = frame;
      frame_time_ = Clock::now();
    }
    wake_.notify_all();
  }

  void takeOdometry(const nav_msgs::Odometry::ConstPtr& message)
  {
    const geometry_msgs::Pose& pose = message->pose.pose;
    geometry_msgs::Transform transform;
    transform.translation.x = pose.position.x;
    transform.translation.y = pose.position.y;
    transform.rotation = pose.orientation;
    const PlanarPose planar = toPlanar(toIsometry(transform));
    if (!std::isfinite(planar.x) || !std::isfinite(planar.y) || !std::isfinite(planar.yaw))
    {
      ROS_ERROR_STREAM_THROTTLE(10.0, "odometry on '" << odometry_subscriber_.getTopic() << "' is not finite");
      return;
    }
    if (!message->child_frame_id.empty() && message->child_frame_id != params_.base_frame)
    {
      ROS_ERROR_STREAM_THROTTLE(10.0, "odometry on '" << odometry_subscriber_.getTopic() << "' is of '"
                                                      << message->child_frame_id << "', ~base_frame is '"
                                                      << params_.base_frame << "'; it is not used");
      return;
    }
    odometry_watch_.feed();
    const std::lock_guard<std::mutex> lock(mutex_);
    checkTime(last_odometry_stamp_, message->header.stamp, "odometry");
    odometry_inbox_.emplace_back(message->header.stamp.toSec(), planar);
    if (last_odometry_)
    {
      travelled_ += compose(inverse(*last_odometry_), planar).distance();
    }
    last_odometry_ = planar;
  }

  void takePoints(const PointMatches::ConstPtr& message)
  {
    takeMatches(message->view, toInput(message->header, message->matches), points_subscriber_.getTopic());
  }

  void takeLines(const LineMatches::ConstPtr& message)
  {
    takeMatches(message->view, toInput(message->header, message->points), lines_subscriber_.getTopic());
  }

  void takeMatches(const std::string& view, const MatchesInput& input, const std::string& topic)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!session_ || view != session_->view)
      {
        if (session_)
        {
          ROS_WARN_STREAM_THROTTLE(
              5.0, "matches on '" << topic << "' are of view '" << view << "', not of '" << session_->view << "'");
        }
        return;
      }
      matches_inbox_.push_back(input);
    }
    match_watch_.feed();
    wake_.notify_all();
  }

  /** Notes when stamps go back, as when a bag loops. The mutex is held. */
  void checkTime(ros::Time& last, const ros::Time& stamp, const std::string& what)
  {
    const std::string jump = timeJump(last, stamp, what);
    if (!jump.empty())
    {
      time_jump_ = jump;
    }
  }

  // ------------------------------------------------------------------------------------------------------- goals

  void enable(const std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response)
  {
    response = gate_.set(request.data != 0);
  }

  /** A new goal; if one is active, it is replaced. */
  void takeGoal()
  {
    HomeToViewGoal goal;
    {
      const std::lock_guard<std::mutex> control_lock(control_mutex_);
      if (goalIsActive())
      {
        finish(false, "another goal has come");
      }
      if (!action_.isNewGoalAvailable())
      {
        return;  // cancelled before it was taken
      }
      goal = *action_.acceptNewGoal();
    }
    std::shared_ptr<Session> session;
    std::string refusal;
    try
    {
      session = makeSession(goal.view.empty() ? params_.view : goal.view, goal);
    }
    catch (const std::exception& error)
    {
      refusal = oneLine(error);
    }
    const std::lock_guard<std::mutex> control_lock(control_mutex_);
    if (session)
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      install(session);
      return;
    }
    HomeToViewResult result;
    result.message = refusal;
    result.final = toHeading(HomingReport());
    action_.setAborted(result, refusal);
    status_.publish(makeStatus(gate_.open() ? ServoStatus::ABORTED : ServoStatus::DISABLED, refusal));
  }

  bool goalIsActive()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return session_ && session_->has_goal;
  }

  std::shared_ptr<Session> makeSession(const std::string& view, const HomeToViewGoal& goal)
  {
    if (!gate_.open())
    {
      throw std::runtime_error("homing is disabled: call ~enable first");
    }
    if (!(goal.timeout >= 0.0 && std::isfinite(goal.timeout)) || !(goal.step >= 0.0 && std::isfinite(goal.step)))
    {
      throw std::invalid_argument("timeout and step must be finite and not negative");
    }
    if (view.empty())
    {
      throw std::invalid_argument("the goal names no view, and ~view is not set");
    }
    auto session = std::make_shared<Session>();
    session->view = view;
    session->has_goal = true;
    session->timeout = goal.timeout > 0.0 ? goal.timeout : params_.timeout;
    HomingParams homing = params_.homing;
    if (goal.step > 0.0)
    {
      homing.step = goal.step;
      homing.near_step = std::min(homing.near_step, goal.step);
    }
    session->homing = makeHoming(homing, target(view));
    setMatchersView(params_.point_matcher, view);
    setMatchersView(params_.line_matcher, view);
    return session;
  }

  /** @throws std::exception saying what is missing. */
  HomingTarget target(const std::string& view)
  {
    const StoredView stored = store_.load(view);
    const CameraFrame frame = camera_.latest();
    HomingTarget result;
    result.image = stored.image;
    result.camera = toCamera(*frame.info);
    if (stored.image.cols != result.camera.width || stored.image.rows != result.camera.height)
    {
      throw std::runtime_error("view '" + view + "' has " + std::to_string(stored.image.cols) + " x " +
                               std::to_string(stored.image.rows) + " pixels, the camera " +
                               std::to_string(result.camera.width) + " x " + std::to_string(result.camera.height));
    }
    const std::string& camera_frame = frame.image->header.frame_id;
    const ros::Duration patience(0.5);
    try
    {
      result.mount = CameraMount(
          toIsometry(tf_buffer_.lookupTransform(params_.base_frame, camera_frame, ros::Time(0), patience).transform));
    }
    catch (const tf2::TransformException& error)
    {
      throw std::runtime_error("tf does not know the camera's frame '" + camera_frame + "' in '" + params_.base_frame +
                               "': " + error.what());
    }
    return result;
  }

  void setMatchersView(const std::string& matcher, const std::string& view)
  {
    if (matcher.empty())
    {
      return;
    }
    const std::string service = nh_.resolveName(matcher + "/set_view");
    SetView call;
    call.request.view = view;
    if (!ros::service::exists(service, false))
    {
      ROS_WARN_STREAM("there is no " << service << ": matches must come from elsewhere");
    }
    else if (!ros::service::call(service, call) || call.response.success == 0)
    {
      throw std::runtime_error(service + " refused the view: " + call.response.message);
    }
  }

  /** Begins a session. Both mutexes are held. */
  void install(std::shared_ptr<Session> session)
  {
    session->start = Clock::now();
    session_ = std::move(session);
    report_ = HomingReport();
    wanted_.setZero();
    limiter_.stop();
    matches_inbox_.clear();
    time_jump_.clear();
    travelled_ = 0.0;
    for (InputWatch* watch : { &image_watch_, &odometry_watch_, &match_watch_ })
    {
      watch->feed();
    }
    inputs_missing_since_.reset();
  }

  /** Stops, then ends the goal and publishes why. The control mutex is held. */
  void finish(bool success, const std::string& reason)
  {
    rest();
    HomeToViewResult result;
    std::uint8_t state = success ? ServoStatus::CONVERGED : ServoStatus::ABORTED;
    ServoStatus status;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      result.success = success ? 1 : 0;
      result.message = reason;
      result.final = toHeading(report_);
      result.travelled = travelled_;
      result.duration = std::chrono::duration<double>(Clock::now() - session_->start).count();
      if (!gate_.open())
      {
        state = ServoStatus::DISABLED;
      }
      status = toStatus(state, reason, report_);
      session_.reset();
    }
    status_.publish(status);
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

  // -------------------------------------------------------------------------------------------- images and matches

  void work()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || goal_pending_ || newest_frame_ || !matches_inbox_.empty(); });
      if (stopping_)
      {
        break;
      }
      if (std::exchange(goal_pending_, false))
      {
        lock.unlock();
        takeGoal();
        lock.lock();
        continue;
      }
      std::deque<MatchesInput> matches;
      matches.swap(matches_inbox_);
      const std::optional<CameraFrame> frame = std::exchange(newest_frame_, std::nullopt);
      const Clock::time_point frame_time = frame_time_;
      if (!session_ && frame)
      {
        lock.unlock();
        watchView();
        lock.lock();
      }
      const std::shared_ptr<Session> session = session_;
      if (!session)
      {
        continue;
      }
      lock.unlock();
      process(*session, matches, frame, frame_time);
      lock.lock();
    }
  }

  /** Without a goal, the direction of ~view is estimated all the same. */
  void watchView()
  {
    if (params_.view.empty())
    {
      return;
    }
    try
    {
      auto session = std::make_shared<Session>();
      session->view = params_.view;
      session->homing = makeHoming(params_.homing, target(params_.view));
      const std::lock_guard<std::mutex> control_lock(control_mutex_);
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!session_)
      {
        const double travelled = travelled_;
        install(session);
        travelled_ = travelled;
      }
    }
    catch (const std::exception& error)
    {
      ROS_WARN_STREAM_THROTTLE(10.0, "view '" << params_.view << "' is not watched: " << oneLine(error));
    }
  }

  void process(Session& session, const std::deque<MatchesInput>& matches, const std::optional<CameraFrame>& frame,
               Clock::time_point frame_time)
  {
    HomingReport report;
    try
    {
      const std::lock_guard<std::mutex> homing_lock(session.mutex);
      drainOdometry(session);
      for (const MatchesInput& input : matches)
      {
        session.homing->addMatches(input.stamp, input.pairs, input.weights);
      }
      if (frame)
      {
        session.homing->addImage(frame->image->header.stamp.toSec(), toGrey(*frame->image, camera_.imageTopic()));
      }
      report = session.homing->report();
    }
    catch (const std::exception& error)
    {
      ROS_ERROR_STREAM_THROTTLE(10.0, oneLine(error));
      return;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (session_.get() != &session)
    {
      return;
    }
    report_ = report;
    if (frame)
    {
      heading_publisher_.publish(toHeading(report_));
      publishArrow(report_);
      unanswered_frame_ = frame_time;
    }
    if (!session.has_goal && (report.state == HomingState::ARRIVED || report.state == HomingState::FAILED))
    {
      session_.reset();  // watched anew with the next image
    }
  }

  /** The session's homing mutex is held. */
  void drainOdometry(Session& session)
  {
    std::vector<std::pair<double, PlanarPose>> inbox;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      inbox.swap(odometry_inbox_);
    }
    for (const auto& [stamp, pose] : inbox)
    {
      session.homing->addOdometry(stamp, pose);
    }
  }

  // ------------------------------------------------------------------------------------------------------ control

  /** Why the base may not move now; empty: it may. The mutex is held. */
  std::string missingInput() const
  {
    const auto silent = [](const InputWatch& watch, const std::string& what, const std::string& topic) {
      return "no " + what + " for " + seconds(watch.timeout()) + " on " + topic;
    };
    if (image_watch_.stale())
    {
      return silent(image_watch_, "image", "'" + camera_.imageTopic() + "'");
    }
    if (odometry_watch_.stale())
    {
      return silent(odometry_watch_, "odometry", "'" + odometry_subscriber_.getTopic() + "'");
    }
    if (match_watch_.stale())
    {
      return silent(match_watch_, "matches",
                    "'" + points_subscriber_.getTopic() + "' or '" + lines_subscriber_.getTopic() + "'");
    }
    return "";
  }

  void control()
  {
    const std::lock_guard<std::mutex> control_lock(control_mutex_);
    std::shared_ptr<Session> session;
    HomingReport report;
    std::string missing;
    std::string jump;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      checkTime(last_now_, ros::Time::now(), "the clock");
      session = session_;
      report = report_;
      missing = missingInput();
      jump = std::exchange(time_jump_, "");
      if (!jump.empty() && session && !session->has_goal)
      {
        session_.reset();
        odometry_inbox_.clear();
      }
    }
    if (!session || !session->has_goal)
    {
      idle();
      return;
    }
    const double elapsed = std::chrono::duration<double>(Clock::now() - session->start).count();
    if (!jump.empty())
    {
      finish(false, jump);
    }
    else if (!gate_.open())
    {
      finish(false, "disabled");
    }
    else if (action_.isPreemptRequested())
    {
      finish(false, "the goal was cancelled");
    }
    else if (report.state == HomingState::ARRIVED || report.state == HomingState::FAILED)
    {
      finish(report.state == HomingState::ARRIVED, report.reason);
    }
    else if (elapsed > session->timeout)
    {
      finish(false, "not arrived within " + seconds(session->timeout) + ": " + report.reason);
    }
    else if (!missing.empty())
    {
      waitForInput(missing, report);
    }
    else
    {
      drive(*session, report);
      return;
    }
    rest();
  }

  void drive(Session& session, const HomingReport& report)
  {
    inputs_missing_since_.reset();
    {
      // While an image is worked on, the last command goes on.
      const std::unique_lock<std::mutex> lock(session.mutex, std::try_to_lock);
      if (lock.owns_lock())
      {
        drainOdometry(session);
        wanted_ = session.homing->command();
      }
    }
    const bool waits = report.state == HomingState::LOST || report.state == HomingState::ACQUIRING;
    if (waits)
    {
      wanted_.setZero();
    }
    if (wanted_.isZero())
    {
      limiter_.stop();
    }
    send(limiter_.next(wanted_, 1.0 / params_.control_rate));
    const std::uint8_t state = report.state == HomingState::LOST        ? ServoStatus::LOST
                               : report.state == HomingState::ACQUIRING ? ServoStatus::ACQUIRING
                                                                        : ServoStatus::SERVOING;
    status_.publish(toStatus(state, report.reason, report));
    const std::optional<Clock::time_point> frame_time = answered();
    if (frame_time)
    {
      const double ms = 1e3 * std::chrono::duration<double>(Clock::now() - *frame_time).count();
      cycles_ += 1;
      cycle_sum_ += ms;
      cycle_max_ = std::max(cycle_max_, ms);
      HomeToViewFeedback feedback;
      feedback.heading = toHeading(report);
      action_.publishFeedback(feedback);
    }
  }

  /** When the last image came, when this is the first command after it was worked on. */
  std::optional<Clock::time_point> answered()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(unanswered_frame_, std::nullopt);
  }

  void waitForInput(const std::string& missing, const HomingReport& report)
  {
    if (!inputs_missing_since_)
    {
      inputs_missing_since_ = Clock::now();
    }
    if (std::chrono::duration<double>(Clock::now() - *inputs_missing_since_).count() > params_.homing.lost_timeout)
    {
      finish(false, missing);
      return;
    }
    status_.publish(toStatus(ServoStatus::LOST, missing, report));
  }

  /** Zero at once. */
  void rest()
  {
    wanted_.setZero();
    limiter_.stop();
    send(BaseVelocity::Zero());
  }

  /** Without a goal: zero for a while, then silence. */
  void idle()
  {
    if (zeros_.due())
    {
      send(BaseVelocity::Zero());
    }
    if (isOutdated(status_.last(), gate_))
    {
      status_.publish(idleStatus(gate_));
    }
  }

  void send(const BaseVelocity& velocity)
  {
    zeros_.sent(velocity.isZero());
    geometry_msgs::TwistStamped stamped;
    stamped.header.stamp = ros::Time::now();
    stamped.header.frame_id = params_.base_frame;
    stamped.twist.linear.x = velocity.x();
    stamped.twist.linear.y = velocity.y();
    stamped.twist.angular.z = velocity.z();
    command_publisher_.publish(stamped.twist);
    stamped_publisher_.publish(stamped);
  }

  // ------------------------------------------------------------------------------------------------------- messages

  Heading toHeading(const HomingReport& report) const
  {
    Heading message;
    message.header.stamp = ros::Time(std::max(0.0, report.stamp));
    message.header.frame_id = params_.base_frame;
    message.heading = report.heading;
    message.yaw_error = report.yaw_error;
    message.confidence = report.confidence;
    message.histogram = report.histogram;
    message.roi_min = report.roi_min;
    message.roi_max = report.roi_max;
    message.similarity = report.similarity;
    message.state = toHeadingState(report);
    return message;
  }

  void publishArrow(const HomingReport& report) const
  {
    if (!std::isfinite(report.heading))
    {
      return;
    }
    geometry_msgs::PoseStamped arrow;
    arrow.header.stamp = ros::Time(std::max(0.0, report.stamp));
    arrow.header.frame_id = params_.base_frame;
    arrow.pose.orientation.z = std::sin(0.5 * report.heading);
    arrow.pose.orientation.w = std::cos(0.5 * report.heading);
    arrow_publisher_.publish(arrow);
  }

  static ServoStatus toStatus(std::uint8_t state, const std::string& reason, const HomingReport& report)
  {
    ServoStatus status = makeStatus(state, reason);
    status.translation_error = report.distance;
    status.rotation_error = std::abs(report.yaw_error);
    status.point_error = report.displacement;
    status.inliers = report.inliers;
    return status;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> control_lock(control_mutex_);
    const std::lock_guard<std::mutex> lock(mutex_);
    const ServoStatus& last = status_.last();
    const bool worrying = last.state == ServoStatus::LOST || last.state == ServoStatus::ABORTED;
    status.summary(worrying ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   last.reason);
    status.add("View", session_ ? session_->view : params_.view);
    status.add("Enabled", gate_.enabled());
    status.add("Dry run", gate_.dryRun());
    status.add("Image to command, mean [ms]", cycles_ > 0 ? cycle_sum_ / cycles_ : NOT_A_NUMBER);
    status.add("Image to command, largest [ms]", cycles_ > 0 ? cycle_max_ : NOT_A_NUMBER);
    status.add("Matches, age [s]", match_watch_.age());
    status.add("Odometry, age [s]", odometry_watch_.age());
    status.add("Inliers", report_.inliers);
    cycles_ = 0;
    cycle_sum_ = cycle_max_ = 0.0;
  }

  CommandGate gate_;
  const Params params_;

  std::mutex control_mutex_;  // guards what follows; taken before mutex_
  BaseVelocityLimiter limiter_;
  BaseVelocity wanted_ = BaseVelocity::Zero();
  std::optional<Clock::time_point> inputs_missing_since_;
  Zeros zeros_;
  int cycles_ = 0;          // of images that commands have followed, since the last diagnosis
  double cycle_sum_ = 0.0;  // [ms]
  double cycle_max_ = 0.0;

  std::mutex mutex_;  // guards what follows; never held while matches or images are worked on
  std::condition_variable wake_;
  std::shared_ptr<Session> session_;
  HomingReport report_;
  std::optional<CameraFrame> newest_frame_;
  Clock::time_point frame_time_;
  std::optional<Clock::time_point> unanswered_frame_;  // worked on, and no command has followed yet
  std::deque<MatchesInput> matches_inbox_;
  std::vector<std::pair<double, PlanarPose>> odometry_inbox_;
  std::optional<PlanarPose> last_odometry_;
  double travelled_ = 0.0;
  ros::Time last_now_;
  ros::Time last_image_stamp_;
  ros::Time last_odometry_stamp_;
  std::string time_jump_;
  bool goal_pending_ = false;
  bool stopping_ = false;

  InputWatch image_watch_;
  InputWatch odometry_watch_;
  InputWatch match_watch_;
  const ViewStore store_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener transforms_;
  ros::Publisher command_publisher_;
  ros::Publisher stamped_publisher_;
  ros::Publisher heading_publisher_;
  ros::Publisher arrow_publisher_;
  StatusOutput status_;
  ros::ServiceServer enable_service_;
  CameraInput camera_;
  ros::Subscriber odometry_subscriber_;
  ros::Subscriber points_subscriber_;
  ros::Subscriber lines_subscriber_;
  ActionServer action_;
  std::thread worker_;
  ros::WallTimer control_timer_;
};

}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runControlNode<view_servo::HomingNode>(argc, argv, "homing");
}
