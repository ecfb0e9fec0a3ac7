// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/course.h"
#include "view_servo/control/heading_vote.h"
#include "view_servo/control/homing.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/worker.h"
#include "view_servo/views/view_store.h"

#include <sensor_msgs/CameraInfo.h>
#include <Eigen/Geometry>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** A stored view with what has been learnt of it. */
struct LearntView
{
  StoredView view;
  std::string revision;     ///< ViewStore::revision() of `view`
  ViewStructure structure;  ///< without points: nothing has been learnt
};

/**
 * Reads a view, and what has been learnt of it; that is left out with a warning when it is damaged. @throws
 * ViewStoreError as ViewStore::load().
 */
LearntView loadLearntView(const ViewStore& store, const std::string& name);

/** Homing to a view: for a goal, or without one, to estimate the view's direction only. */
struct HomingTask
{
  std::string view;                      ///< name of the stored view
  std::string revision;                  ///< ViewStore::revision() of it
  sensor_msgs::CameraInfoConstPtr info;  ///< calibration that `homing` was made with
  std::unique_ptr<Homing> homing;        ///< only the worker's thread uses it
  bool lesson = false;                   ///< the view is to be learnt: its structure is stored without an arrival, too
  bool structure_stored = false;         ///< storeStructure() has stored the structure
  Camera camera;                         ///< calibration of the camera that is there now
  Camera view_camera;                    ///< calibration of the camera that took the view
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();  ///< the optical frame's pose in base_link
};

/**
 * The task of homing to a stored view.
 * @param info calibration of the images that homing will get. @param base_from_camera pose of their optical frame in
 * base_link.
 * @throws std::invalid_argument saying why homing to this view by such images cannot be.
 */
std::shared_ptr<HomingTask> makeHomingTask(const LearntView& stored, const sensor_msgs::CameraInfoConstPtr& info,
                                           const Eigen::Isometry3d& base_from_camera, const HomingParams& params);

/** The result of the images and matches that the worker took together. */
struct HomingOutcome
{
  std::shared_ptr<HomingTask> task;                                 ///< the task that the inputs were for
  HomingReport report;                                              ///< what is known after them
  Course course;                                                    ///< where to go after them
  std::optional<std::chrono::steady_clock::time_point> frame_time;  ///< when the image came; empty: none
  std::string fault;  ///< why the inputs could not be used; empty: they could
};

/**
 * Stores, once, what a task has learnt of its view: when the base has arrived, and in a lesson when it is 0.3 m away
 * from the view, knows that in metres, and has learnt 30 points. That storing failed is a warning. Takes as long as a
 * disk does: only for the worker's thread.
 * @return whether it was tried now.
 */
bool storeStructure(const ViewStore& store, const HomingOutcome& outcome);

/**
 * Works on images, matches and odometry for one task at a time, in a thread of its own because an image takes longer
 * than a cycle of control. Of what comes while it is busy, it takes the newest image, the newest two messages of
 * matches and all odometry.
 */
class HomingWorker
{
public:
  /**
   * Both are called by the worker's thread.
   * @param on_outcome called after each piece of work. @param on_idle_frame called with images that come without a
   * task.
   */
  HomingWorker(std::function<void(const HomingOutcome&)> on_outcome,
               std::function<void(const CameraFrame&)> on_idle_frame);

  /** Replaces the task, and forgets what has come for the old one; null: no task. */
  void setTask(const std::shared_ptr<HomingTask>& task);

  /** Pose of the base in odometry's frame. @param stamp by the images' clock [s]. */
  void addOdometry(double stamp, const PlanarPose& base_in_odom);
  /** Matches of an image. @param stamp of that image [s]. @param evidence in pixels of the raw images. */
  void addMatches(double stamp, const HeadingEvidence& evidence);
  /** An image with its calibration. */
  void addFrame(const CameraFrame& frame);

private:
  struct Inputs
  {
    std::optional<std::shared_ptr<HomingTask>> task;      ///< to which the rest of the inputs belongs; empty: as before
    std::vector<std::pair<double, PlanarPose>> odometry;  ///< by stamp [s]
    std::vector<std::pair<double, HeadingEvidence>> matches;  ///< by stamp [s]
    std::optional<CameraFrame> frame;                         ///< the newest image; empty: none has come
    std::chrono::steady_clock::time_point frame_time;         ///< when that came
  };

  void work(const Inputs& inputs);
  void add(const Inputs& inputs, Homing& homing) const;

  const std::function<void(const HomingOutcome&)> on_outcome_;
  const std::function<void(const CameraFrame&)> on_idle_frame_;
  std::shared_ptr<HomingTask> task_;  // the thread's alone
  Worker<Inputs> worker_;
};

}  // namespace view_servo
