// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "rviz_panel/robot_snapshot.h"
#include "rviz_panel/task_worker.h"

#include <opencv2/core/types.hpp>

#include <array>
#include <memory>
#include <string>

namespace view_servo
{
/**
 * Stores views, and drives a robot to them, by topics, services and actions of the nodes. No method waits: services are
 * called by workers, each call with a deadline, and what comes of it is in a later snapshot(). For one thread.
 */
class RobotLink
{
public:
  explicit RobotLink(const RobotNames& names);
  /** Ends all calls; waits no longer than TaskWorker does. Goals go on. */
  ~RobotLink();
  /** What has come so far. To be called often: it also ends calls that are late, and looks for views now and then. */
  RobotSnapshot snapshot();
  /** Whether to subscribe to the overlay; not at first. */
  void showOverlay(bool shown);
  /** Reads all views anew, also those that are known. */
  void reloadViews();
  /** Stores what the camera sees. @param region [px]; empty: everywhere. @param learn homing learns the view. */
  void store(const std::string& view, const cv::Rect& region, bool overwrite, bool learn);
  void deleteView(const std::string& view);
  /** Sends a goal to the driver that is there. */
  void go(const std::string& view);
  /** Opens the gate of the driver that is there. */
  void enable();
  /**
   * Cancels all goals of both drivers at once, by topics that were advertised before; then closes their gates, whatever
   * was asked of them before.
   */
  void stop();

private:
  class Core;

  /** A task that calls body(Core&, ServiceCaller&), and says what that throws. */
  template <typename Body>
  TaskWorker::Task task(Body body) const;
  std::shared_ptr<Core> core_;
  TaskWorker views_;                       // view_store and the master
  std::array<TaskWorker, DRIVERS> gates_;  // one a driver, so that one that hangs does not hold up the others
};

}  // namespace view_servo
