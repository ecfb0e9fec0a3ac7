// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/homing_worker.h"

#include "view_servo/ros/conversions.h"

#include <cstddef>

namespace view_servo
{
std::shared_ptr<HomingTask> makeHomingTask(const StoredView& stored, const sensor_msgs::CameraInfoConstPtr& info,
                                           const CameraMount& mount, const HomingParams& params)
{
  HomingTarget target;
  target.image = stored.image;
  target.camera = toCamera(*info);
  target.view_camera = cameraOf(stored, target.camera);
  target.mount = mount;
  return std::make_shared<HomingTask>(HomingTask{ stored.name, info, makeHoming(params, target) });
}

HomingWorker::HomingWorker(std::string image_topic, std::function<void(const HomingOutcome&)> on_outcome,
                           std::function<void(const CameraFrame&)> on_idle_frame)
  : image_topic_(std::move(image_topic)),
    on_outcome_(std::move(on_outcome)),
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
    homing.addImage(inputs.frame->image->header.stamp.toSec(), toGrey(*inputs.frame->image, image_topic_));
  }
}

}  // namespace view_servo
