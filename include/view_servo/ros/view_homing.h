// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ServoStatus.h"
#include "view_servo/control/course.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/motion_watch.h"
#include "view_servo/control/route_guide.h"
#include "view_servo/control/travelled_way.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/ros/base_output.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/driver_params.h"
#include "view_servo/ros/homing_worker.h"
#include "view_servo/ros/live_parameters.h"
#include "view_servo/ros/marker_output.h"
#include "view_servo/ros/odometry_input.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/ros/view_answer.h"
#include "view_servo/views/view_store.h"

#include "view_servo/PointMatch.h"

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <std_msgs/Header.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/**
 * What the drivers of a mobile base share: inputs, the thread that works on them, and the course that this leaves. It
 * homes to one view at a time, the one of its task, and whoever owns it decides which.
 *
 * Subscribes `image_raw`, `camera_info` (see CameraInput), `point_matches` (view_servo/PointMatches), `line_matches`
 * (view_servo/LineMatches), `odom` (nav_msgs/Odometry) and tf; publishes what BaseOutput does, and `~markers`
 * (visualization_msgs/MarkerArray, latched), see markers.h: of each image while somebody subscribes; deleted with the
 * task.
 *
 * Of the parameters, `gain` and `turn_gain` may be changed while the node runs, and `distance_tolerance` and
 * `yaw_tolerance`, which count from the next task on; see LiveParameters.
 *
 * Unless something else is said, members are called with the mutex of the DriverContext held. As its threads call the
 * hooks, it has to be the last member of its owner, so that it is destroyed first.
 */
class ViewHoming
{
public:
  /** What the owner does besides. All may be empty. */
  struct Hooks
  {
    std::function<void()> on_frame;          ///< after each image that can be used; mutex held
    std::function<void()> on_odometry;       ///< after each reading of odometry that is the newest; mutex held
    std::function<void()> on_image_outcome;  ///< after the work on an image of the task; mutex held
    std::function<void(const HomingOutcome&)> on_work;  ///< after each piece of work, by its thread; not held
    std::function<void(const CameraFrame&)> on_frame_without_task;  ///< by the worker's thread; not held
    std::function<RoutePlaces()> route = nullptr;  ///< where the route's stops are, for the markers; mutex held
  };

  /** References to `context` and `params` are kept. */
  ViewHoming(DriverContext& context, const HomingDriverParams& params, Hooks hooks);

  // ------------------------------------------------------------------- for prepare(): they wait, without the mutex

  /**
   * Asks matchers for a view, and waits for odometry, tf, and an image that comes after the call, which is returned.
   * @throws what DriverContext::waitFor() throws.
   */
  CameraFrame waitForInputs(const std::string& view);
  /** Waits until a matcher has answered. @throws std::runtime_error also when all refuse the view. */
  void waitForAnswer();

  // ------------------------------------------------------------------------------------------- with or without it

  /** The task of homing to a view. @throws std::runtime_error saying why homing by such frames cannot be. */
  std::shared_ptr<HomingTask> makeTask(const LearntView& stored, const CameraFrame& frame,
                                       const HomingParams& params) const;
  const ViewStore& viewStore() const
  {
    return store_;
  }
  /** Name of the base's frame. */
  const std::string& baseFrame() const
  {
    return base_frame_;
  }

  // ------------------------------------------------------------------------------------------------- with the mutex

  /** From now on only matches of this view, for this goal, are used. @param view empty: none. @param goal its id. */
  void expectView(const std::string& view, const std::string& goal);
  /** Replaces the task, and forgets all that belongs to the old one; null: no task. */
  void setTask(std::shared_ptr<HomingTask> task);
  /**
   * Sets whether the base may move without matches although the view's points are not tracked; setTask() sets false.
   */
  void setDoesWithoutMatches(bool does);
  /** Makes travelled() zero, and forgets the way driven. */
  void restartWay()
  {
    travelled_ = 0.0;
    driven_.clear();
  }

  /** The task set last; null: none. */
  const std::shared_ptr<HomingTask>& task() const
  {
    return task_;
  }
  /** What the newest outcome of the task says. */
  const HomingReport& report() const
  {
    return report_;
  }
  /** The newest pose of the base in odometry's frame; empty before the first. */
  const std::optional<PlanarPose>& base() const
  {
    return base_in_odom_;
  }
  /** Length of the base's way since restartWay(), by odometry [m]. */
  double travelled() const
  {
    return travelled_;
  }

  /**
   * The velocity along a course, by the newest odometry. Zero while stamps of images and odometry are too far apart.
   */
  BaseVelocity follow(const Course& course) const;
  /** The same along the course of homing. */
  BaseVelocity velocity() const
  {
    return follow(course_);
  }

  // See DriverNode.
  void sent(double time, const BaseVelocity& velocity)
  {
    motion_.addCommand(time, velocity);
  }
  bool hasListener() const
  {
    return output_.hasListener();
  }
  void publish(const BaseVelocity& velocity) const
  {
    output_.publish(velocity);
  }
  std::optional<double> takeLatency();
  void fill(ServoStatus& status) const;
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const;

private:
  using Clock = std::chrono::steady_clock;

  /** The parameters that may be changed while the node runs. */
  LiveGroup liveNumbers();
  std::string odometryLacks() const;
  void needMatches(bool needed);
  void endIfTimeWentBack(const DriverInput& input);
  void endIfStampsAreApart();
  void onFrame(const CameraFrame& frame);
  void onOdometry(const OdometryInput::Event& event);
  void onMatches(bool wanted, const std_msgs::Header& header, const std::vector<PointMatch>& matches);
  void onOutcome(const HomingOutcome& outcome);
  /** Publishes what is known as markers, if somebody wants them. By the worker's thread, without the mutex. */
  void draw(const HomingOutcome& outcome);

  DriverContext& context_;
  const HomingDriverParams& params_;
  const Hooks hooks_;
  const std::string base_frame_;
  DriverInput& images_;    // usable images
  DriverInput& outcomes_;  // of the worker
  TransformSource transforms_;
  OdometryInput odometry_;
  DriverInput& matches_;  // of either matcher
  ViewAnswer points_;     // of point_matches
  ViewAnswer lines_;      // of line_matches
  const ViewStore store_;
  const BaseOutput output_;
  MarkerOutput markers_;

  std::shared_ptr<HomingTask> task_;  // the newest
  HomingReport report_;
  Course course_;
  std::optional<PlanarPose> base_in_odom_;
  MotionWatch motion_;
  double travelled_ = 0.0;
  TravelledWay driven_;                          // since the goal began, or without one, since there is a task
  int odd_stamps_ = 0;                           // images in a row whose stamps are too far from odometry's
  bool matches_needed_ = true;                   // because the view's points are not tracked
  bool does_without_matches_ = false;            // see setDoesWithoutMatches()
  std::optional<Clock::time_point> unanswered_;  // when an image came that was worked on, until a command follows

  // What people have changed while the node runs.
  std::atomic<double> gain_share_{ 1.0 };       // of the gain that the node was started with
  std::atomic<double> turn_gain_share_{ 1.0 };  // of the turn gain
  std::atomic<double> distance_tolerance_;      // of tasks that are made from now on [m]
  std::atomic<double> yaw_tolerance_;           // [rad]

  HomingWorker worker_;
  CameraInput camera_;
};

}  // namespace view_servo
