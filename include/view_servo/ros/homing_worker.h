// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/course.h"
#include "view_servo/control/heading_vote.h"
#include "view_servo/control/homing.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/worker.h"

#include <sensor_msgs/CameraInfo.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** An attempt to reach a view, or, without a goal, the watch for its direction. */
struct HomingTask
{
  std::string view;
  sensor_msgs::CameraInfoConstPtr info;  ///< calibration that it relies on
  std::unique_ptr<Homing> homing;        ///< only the worker's thread uses it
};

/** What has come of the images and matches that the worker took at once. */
struct HomingOutcome
{
  std::shared_ptr<HomingTask> task;
  HomingReport report;
  Course course;
  std::optional<std::chrono::steady_clock::time_point> frame_time;  ///< when the image came; empty: there was none
  std::string fault;                                                ///< why it could not be worked on; empty: it could
};

/**
 * Works on images, matches and odometry of one task at a time in a thread of its own, because an image takes longer than a cycle of
 * control. Of the images that come meanwhile it takes the newest, of matches the newest two.
 */
class HomingWorker
{
public:
  /**
   * Both are called by the worker's thread.
   * @param on_outcome after each time that it has worked. @param on_idle_frame with images that come while there is no task.
   */
  HomingWorker(std::string image_topic, std::function<void(const HomingOutcome&)> on_outcome,
               std::function<void(const CameraFrame&)> on_idle_frame);

  /** Works for another task from now on, and forgets what had come for the last one; null: for none. */
  void start(const std::shared_ptr<HomingTask>& task);

  void addOdometry(double stamp, const PlanarPose& base_in_odom);
  /** @param evidence in pixels of the raw images. */
  void addMatches(double stamp, const HeadingEvidence& evidence);
  void addFrame(const CameraFrame& frame);

private:
  struct Inbox
  {
    std::optional<std::shared_ptr<HomingTask>> task;          ///< that all else belongs to; empty: the same as before
    std::vector<std::pair<double, PlanarPose>> odometry;      ///< by stamp [s]
    std::vector<std::pair<double, HeadingEvidence>> matches;  ///< likewise
    std::optional<CameraFrame> frame;                         ///< the newest
    std::chrono::steady_clock::time_point frame_time;
  };

  void work(const Inbox& inbox);
  void add(const Inbox& inbox, Homing& homing) const;

  const std::string image_topic_;
  const std::function<void(const HomingOutcome&)> on_outcome_;
  const std::function<void(const CameraFrame&)> on_idle_frame_;
  std::shared_ptr<HomingTask> task_;  // the thread's alone
  Worker<Inbox> worker_;
};

}  // namespace view_servo
