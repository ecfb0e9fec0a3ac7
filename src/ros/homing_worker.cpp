// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/homing_worker.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"

#include <ros/console.h>

#include <cstddef>

namespace view_servo
{
std::shared_ptr<HomingTask> makeHomingTask(const LearntView& stored, const sensor_msgs::CameraInfoConstPtr& info,
                                           const Eigen::Isometry3d& base_from_camera, const HomingParams& params)
{
  HomingTarget target;
  target.image = stored.view.image;
  target.camera = toCamera(*info);
  target.view_camera = cameraOf(stored.view, target.camera);
  target.mount = CameraMount(base_from_camera);
  target.structure = stored.structure;
  return std::make_shared<HomingTask>(HomingTask{ stored.view.name, stored.revision, info, makeHoming(params, target),
                                                  false, false, target.camera, target.view_camera, base_from_camera });
}

LearntView loadLearntView(const ViewStore& store, const std::string& name)
{
  LearntView result;
  result.revision = store.revision(name);
  result.view = store.load(name);
  try
  {
    result.structure = store.loadStructure(name);
  }
  catch (const ViewStoreError& error)
  {
    ROS_WARN_STREAM(oneLine(error) << "; it is learnt anew");
  }
  return result;
}

bool storeStructure(const ViewStore& store, const HomingOutcome& outcome)
{
  constexpr double FAR_ENOUGH = 0.3;  // [m]
  constexpr std::size_t ENOUGH = 30;  // points of a lesson
  HomingTask& task = *outcome.task;
  const HomingReport& report = outcome.report;
  const bool learnt =
      task.lesson ? report.goal_in_odom && report.distance >= FAR_ENOUGH : report.state == HomingState::ARRIVED;
  if (task.structure_stored || !learnt)
  {
    return false;
  }
  const ViewStructure structure = task.homing->structure();
  if (task.lesson && structure.points.size() < ENOUGH)
  {
    return false;
  }
  task.structure_stored = true;
  try
  {
    if (!structure.points.empty() && store.saveStructure(task.view, task.revision, structure))
    {
      ROS_INFO_STREAM("view '" << task.view << "': the depths of " << structure.points.size() << " points are stored");
    }
  }
  catch (const ViewStoreError& error)
  {
    ROS_WARN_STREAM(oneLine(error));
  }
  return true;
}

HomingWorker::HomingWorker(std::function<void(const HomingOutcome&)> on_outcome,
                           std::function<void(const CameraFrame&)> on_idle_frame)
  : on_outcome_(std::move(on_outcome)),
    on_idle_frame_(std::move(on_idle_frame)),
    worker_("work on images and matches", [this](Inputs&& inputs) { work(inputs); })
{
}

void HomingWorker::setTask(const std::shared_ptr<HomingTask>& task)
{
  worker_.put([&](Inputs& inputs) {
    inputs = Inputs();
    inputs.task = task;
  });
}

void HomingWorker::addOdometry(double stamp, const PlanarPose& base_in_odom)
{
  worker_.put([&](Inputs& inputs) { inputs.odometry.emplace_back(stamp, base_in_odom); });
}

void HomingWorker::addMatches(double stamp, const HeadingEvidence& evidence)
{
  // One of points and one of lines: where work takes longer than the time between two, a queue would grow without end.
  constexpr std::size_t MOST = 2;
  worker_.put([&](Inputs& inputs) {
    if (inputs.matches.size() >= MOST)
    {
      inputs.matches.erase(inputs.matches.begin());
    }
    inputs.matches.emplace_back(stamp, evidence);
  });
}

void HomingWorker::addFrame(const CameraFrame& frame)
{
  worker_.put([&](Inputs& inputs) {
    inputs.frame = frame;
    inputs.frame_time = std::chrono::steady_clock::now();
  });
}

void HomingWorker::work(const Inputs& inputs)
{
  task_ = inputs.task.value_or(task_);
  if (!task_)
  {
    if (inputs.frame)
    {
      on_idle_frame_(*inputs.frame);
    }
    return;
  }
  HomingOutcome outcome;
  outcome.task = task_;
  outcome.fault = guarded("work on an image", [&] { add(inputs, *task_->homing); });
  outcome.report = task_->homing->report();
  outcome.course = task_->homing->course();
  if (inputs.frame)
  {
    outcome.frame_time = inputs.frame_time;
  }
  on_outcome_(outcome);
}

void HomingWorker::add(const Inputs& inputs, Homing& homing) const
{
  for (const auto& [stamp, pose] : inputs.odometry)
  {
    homing.addOdometry(stamp, pose);
  }
  for (const auto& [stamp, evidence] : inputs.matches)
  {
    homing.addMatches(stamp, evidence);
  }
  if (inputs.frame)
  {
    homing.addImage(inputs.frame->image->header.stamp.toSec(), toGrey(*inputs.frame->image));
  }
}

}  // namespace view_servo
