// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/base_driver.h"
#include "nodes/nodes.h"

#include "view_servo/FollowRouteAction.h"
#include "view_servo/RecognizedViews.h"
#include "view_servo/control/route_guide.h"
#include "view_servo/ros/driver_node.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/view_homing.h"
#include "view_servo/ros/worker.h"
#include "view_servo/views/route_store.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** A goal that is ready to begin. */
struct RouteTask
{
  std::vector<RouteStop> stops;       ///< to drive to, in order
  std::shared_ptr<HomingTask> first;  ///< homing to the first of them
  CameraFrame frame;                  ///< whose calibration and frame the homing to all of them is made with
};

/**
 * Drives a mobile base along a stored route. Private parameters: see RouteFollowerParams.
 *
 * Subscribes what ViewHoming does, of matchers that follow `~wanted_view`; and, while a goal
 * without a start is prepared or a view has not been found for a while, `recognized` (view_servo/RecognizedViews), of
 * view_recognizer, which says where to go on.
 *
 * Publishes, besides what every driver does (see DriverNode), what BaseOutput does.
 * Action: `follow` (view_servo/FollowRoute).
 *
 * It homes to one view after another, and goes on when it is near enough to one that is not the last (see RouteGuide).
 * What homing to the next view needs is read from disk by a thread of its own, while the base drives to the one before.
 */
class RouteDriver : public BaseDriver
{
public:
  using Action = FollowRouteAction;
  using Task = RouteTask;
  using Params = RouteFollowerParams;
  static constexpr const char* ACTION = "follow";

  RouteDriver(DriverContext& context, const Params& params)
    : BaseDriver(homing_),
      context_(context),
      params_(params),
      routes_(viewsDir(params.views_dir)),
      homing_(context, params_,
              { {},
                [this] { onOdometry(); },
                [this] { onImageOutcome(); },
                [this](const HomingOutcome& outcome) {
                  storeStructure(homing_.viewStore(), outcome);
                  listenToRecognizer();
                },
                [this](const CameraFrame& /*frame*/) {
                  listenToRecognizer();  // no longer, as there is no goal
                },
                [this] {
                  return guide_ ? guide_->places(MOST_STOPS) : RoutePlaces();
                } }),
      worker_("reading the next view of a route", [this](Order&& order) { load(order); })
  {
  }

  // -------------------------------------------------------------------------------------------------------- goals

  std::unique_ptr<Task> prepare(const FollowRouteGoal& goal)
  {
    if (!(goal.timeout >= 0.0 && std::isfinite(goal.timeout)))
    {
      throw std::invalid_argument("timeout must be finite and not negative");
    }
    if (goal.route.empty() && goal.goal.empty())
    {
      throw std::invalid_argument("the goal names neither a route nor a view on one");
    }
    if (goal.reverse && params_.homing.approach.base == BaseKind::DIFFERENTIAL)
    {
      throw std::invalid_argument(
          "a differential base cannot follow a route in reverse: record it in the other direction");
    }
    const Route route = routes_.load(goal.route.empty() ? routes_.routeWith(goal.goal) : goal.route);
    auto task = std::make_unique<Task>();
    task->stops = stopsBetween(route, goal.start, goal.goal, goal.reverse);
    if (goal.start.empty())
    {
      beginWhereTheBaseIs(task->stops);
    }
    const std::string& view = task->stops.front().view;
    const LearntView stored = loadStop(task->stops.front());
    task->frame = homing_.waitForInputs(view);
    task->first = homing_.makeTask(stored, task->frame, params_.homing);
    homing_.waitForAnswer();
    return task;
  }

  void begin(std::unique_ptr<Task> task)
  {
    frame_ = task->frame;
    stops_ = task->stops;
    guide_.emplace(params_.guide, stops_, params_.homing.blind_speed);
    lost_since_.reset();
    homing_.setTask(task->first);
    homing_.restartWay();
    orderNext();
  }

  void end()
  {
    guide_.reset();
    next_.reset();
    lost_since_.reset();
    homing_.setTask(nullptr);
    homing_.expectView("", "");
  }

  static std::string idleView()
  {
    return "";
  }

  // ------------------------------------------------------------------------------------------------------ control

  Progress progress() const
  {
    Progress progress = toProgress(homing_.report());
    const std::string where =
        "view '" + guide_->view() + "', " + std::to_string(guide_->number()) + " of " + std::to_string(guide_->count());
    if (progress.state == Progress::ARRIVED && !guide_->last())
    {
      return { Progress::ACQUIRING, where + ": waits for the next view to be read" };
    }
    const bool unknown = progress.state == Progress::ACQUIRING || progress.state == Progress::LOST;
    if (unknown && blindCourse())
    {
      return { Progress::DRIVING, where + ": goes on by odometry until the view is found" };
    }
    progress.reason = where + ": " + progress.reason;
    return progress;
  }

  Velocity wanted(double /*time*/) const
  {
    const std::optional<Course> blind = blindCourse();
    return blind ? homing_.follow(*blind) : homing_.velocity();
  }

  // ----------------------------------------------------------------------------------------------------- messages

  using BaseDriver::fill;

  void fill(FollowRouteResult& result) const
  {
    result.travelled = guide_ ? homing_.travelled() : 0.0;
  }

  void fill(FollowRouteFeedback& feedback, const ServoStatus& /*status*/) const
  {
    feedback.view = guide_->view();
    feedback.share = homing_.report().confidence;
    const RouteGuide::Deviation deviation =
        homing_.base() ? guide_->deviation(*homing_.base()) : RouteGuide::Deviation();
    feedback.sideways = deviation.sideways;
    feedback.yaw = deviation.yaw;
  }

private:
  using Clock = std::chrono::steady_clock;

  static constexpr std::size_t MOST_STOPS = 100;  // that markers show to either side of the base

  /** What the loader has to read. */
  struct Order
  {
    std::string goal;  ///< id of the goal that it is for
    RouteStop stop;
    CameraFrame frame;
  };

  /** @throws std::runtime_error also when the view is not the one that was recorded. */
  LearntView loadStop(const RouteStop& stop) const
  {
    constexpr double SAME = 1e-3;  // [s]
    LearntView learnt = loadLearntView(homing_.viewStore(), stop.view);
    if (!(std::abs(learnt.view.stamp - stop.stamp) < SAME))
    {
      throw std::runtime_error("view '" + stop.view +
                               "' has been stored anew since the route was recorded: record the route anew");
    }
    return learnt;
  }

  /** The first verified view of a recognizer's answer that is one of the stops; empty: none. */
  static std::string seenOf(const std::vector<RouteStop>& stops, const RecognizedViews& message)
  {
    for (const RecognizedView& seen : message.views)
    {
      const auto is_there = [&](const RouteStop& stop) {
        return stop.view == seen.view;
      };
      if (seen.verified != 0 && std::any_of(stops.begin(), stops.end(), is_there))
      {
        return seen.view;
      }
    }
    return "";
  }

  /**
   * Drops the stops before the one that a recognizer sees. Nothing happens when there is no recognizer, or it sees none
   * of them within a few seconds. By a topic, as drivers call no services. Waits, without the mutex.
   */
  void beginWhereTheBaseIs(std::vector<RouteStop>& stops)
  {
    constexpr double PRESENCE = 0.5;  // until a recognizer is known to be there [s]
    constexpr double PATIENCE = 4.0;  // with its answer [s]
    struct Answer
    {
      std::mutex mutex;
      std::string view;
    };
    const auto answer = std::make_shared<Answer>();
    const ros::Time now = ros::Time::now();
    const boost::function<void(const RecognizedViews::ConstPtr&)> take = [=](const RecognizedViews::ConstPtr& message) {
      const std::string view = message->header.stamp >= now ? seenOf(stops, *message) : "";
      const std::lock_guard<std::mutex> lock(answer->mutex);
      answer->view = answer->view.empty() ? view : answer->view;
    };
    ros::NodeHandle nh = context_.nodeHandle();
    const ros::Subscriber subscriber = nh.subscribe<RecognizedViews>("recognized", 1, take);
    const auto given_up = [this] {
      return !context_.isStillWanted();
    };
    waitUntilReady(
        PRESENCE, [&] { return subscriber.getNumPublishers() > 0 ? "" : "a recognizer"; }, given_up);
    if (subscriber.getNumPublishers() == 0)
    {
      return;
    }
    const auto seen = [&] {
      const std::lock_guard<std::mutex> lock(answer->mutex);
      return answer->view;
    };
    waitUntilReady(
        PATIENCE, [&] { return seen().empty() ? "a recognizer's answer on '" + subscriber.getTopic() + "'" : ""; },
        given_up);
    const std::string view = seen();
    if (given_up())
    {
      return;
    }
    if (view.empty())
    {
      ROS_INFO_STREAM("the recognizer on '" << subscriber.getTopic() << "' has seen no view of the route in "
                                            << PATIENCE << " s, so the route begins at its first");
    }
    else
    {
      const auto stop =
          std::find_if(stops.begin(), stops.end(), [&](const RouteStop& other) { return other.view == view; });
      if (comesByAgain(stops, 0, static_cast<std::size_t>(stop - stops.begin())))
      {
        ROS_INFO_STREAM("view '" << view << "', which the recognizer sees, is where the route begins, too");
        return;
      }
      ROS_INFO_STREAM("the route begins at view '" << view << "', which the recognizer sees");
      stops.erase(stops.begin(), stop);
    }
  }

  /**
   * A base that cannot slide stands until the next view is found: what it would have to do is not known without one.
   */
  std::optional<Course> blindCourse() const
  {
    if (!guide_ || params_.homing.approach.base != BaseKind::HOLONOMIC)
    {
      return std::nullopt;
    }
    std::optional<Course> course = guide_->blindCourse();
    if (course)
    {
      course->gain = params_.homing.approach.gain;
      course->turn_gain = params_.homing.approach.turn_gain;
    }
    return course;
  }

  void orderNext()
  {
    next_.reset();
    order(guide_->next());
  }

  /** Has a view read; empty: none any more. @param jumps the base drives to it at once, wherever it is. */
  void order(const std::string& view, bool jumps = false)
  {
    ordered_ = view;
    jumps_ = jumps;
    if (!view.empty())
    {
      const auto stop =
          std::find_if(stops_.begin(), stops_.end(), [&](const RouteStop& other) { return other.view == view; });
      worker_.put([&](Order& order) { order = { context_.goalId(), *stop, frame_ }; });
    }
  }

  /** By the loader's thread. */
  void load(const Order& order)
  {
    std::shared_ptr<HomingTask> task;
    const std::string fault = guarded("reading view '" + order.stop.view + "'", [&] {
      task = homing_.makeTask(loadStop(order.stop), order.frame, params_.homing);
    });
    context_.locked([&] {
      if (!guide_ || context_.goalId() != order.goal || ordered_ != order.stop.view)
      {
        return;
      }
      if (!fault.empty())
      {
        context_.abort("the route cannot go on: " + fault);
      }
      else if (order.stop.view == guide_->next() && !jumps_)
      {
        next_ = task;
      }
      else if (!lost_since_)
      {
        orderNext();  // the view was found again meanwhile
      }
      else
      {
        guide_->jumpTo(order.stop.view);
        driveTo(task);
      }
    });
  }

  void onOdometry()
  {
    if (guide_)
    {
      guide_->addOdometry(*homing_.base());
      homing_.setDoesWithoutMatches(blindCourse().has_value());
    }
  }

  void onImageOutcome()
  {
    if (!guide_ || !context_.goalRuns() || !homing_.base())
    {
      return;
    }
    guide_->addReport(homing_.report(), *homing_.base());
    if (guide_->isTimeToGoOn() && next_)
    {
      guide_->goOn();
      driveTo(std::exchange(next_, nullptr));
    }
    homing_.setDoesWithoutMatches(blindCourse().has_value());
    const HomingState state = homing_.report().state;
    if (state != HomingState::ACQUIRING && state != HomingState::LOST)
    {
      lost_since_.reset();
    }
    else if (!lost_since_)
    {
      lost_since_ = Clock::now();
    }
  }

  /** From now on the guide's view is homed to. */
  void driveTo(std::shared_ptr<HomingTask> task)
  {
    ROS_INFO_STREAM("the route goes on to view '" << guide_->view() << "', " << guide_->number() << " of "
                                                  << guide_->count());
    homing_.setTask(std::move(task));
    homing_.expectView(guide_->view(), context_.goalId());
    context_.requestNextView(guide_->view());
    lost_since_.reset();
    orderNext();
  }

  /**
   * Listens to a recognizer, if there is one, while the view has not been found for a while. By homing's thread, as it
   * may take a while.
   */
  void listenToRecognizer()
  {
    constexpr std::chrono::seconds PATIENCE(2);
    const bool lost = context_.locked([&] { return guide_ && lost_since_ && Clock::now() - *lost_since_ > PATIENCE; });
    if (!lost)
    {
      recognized_.shutdown();
    }
    else if (!recognized_)
    {
      const ros::Time now = ros::Time::now();
      const boost::function<void(const RecognizedViews::ConstPtr&)> take =
          [this, now](const RecognizedViews::ConstPtr& message) {
            context_.runLocked("a recognizer's answer", [&] { onRecognized(*message, now); });
          };
      recognized_ = context_.nodeHandle().subscribe<RecognizedViews>("recognized", 1, take);
    }
  }

  /** The base goes on at the view that a recognizer sees. @param since older images do not count. */
  void onRecognized(const RecognizedViews& message, const ros::Time& since)
  {
    if (guide_ && lost_since_ && context_.goalRuns() && message.header.stamp >= since)
    {
      const std::string view = seenOf(stops_, message);
      if (!view.empty() && guide_->mayJumpTo(view) && !(jumps_ && view == ordered_))
      {
        order(view, true);
      }
    }
  }

  DriverContext& context_;
  const Params params_;
  const RouteStore routes_;
  std::optional<RouteGuide> guide_;   // while a goal runs
  std::shared_ptr<HomingTask> next_;  // to the view after this one, once it is read
  CameraFrame frame_;
  std::vector<RouteStop> stops_;                 // of the goal
  std::string ordered_;                          // the view that is read, or was last
  bool jumps_ = false;                           // the base drives to that one at once
  std::optional<Clock::time_point> lost_since_;  // the view is not found
  ros::Subscriber recognized_;                   // homing's thread's alone
  // Their threads use what is above, and homing's the worker, only while a goal runs; the worker may still use homing.
  ViewHoming homing_;
  Worker<Order> worker_;
};

const NodeType ROUTE_FOLLOWER = driverType<DriverNode<RouteDriver>>("route_follower");

}  // namespace view_servo
