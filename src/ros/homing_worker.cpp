// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/homing_worker.h"

#include "view_servo/ros/conversions.h"

#include <cstddef>

namespace view_servo
{
HomingWorker::HomingWorker(std::string image_topic, std::function<void(const HomingOutcome&)> on_outcome,
                           std::function<void(const CameraFrame&)> on_idle_frame)
  : image_topic_(std::move(image_topic)),
    on_outcome_(std::move(on_outcome)),
    on_idle_frame_(std::move(on_idle_frame)),
    worker_("work on images and matches", [this](Inbox&& inbox) { work(inbox); })
{
}

void HomingWorker::setTask(const std::shared_ptr<HomingTask>& task)
{
  worker_.put([&](Inbox& inbox) {
    inbox = Inbox();
    inbox.task = task;
  });
}

void HomingWorker::addOdometry(double stamp, const PlanarPose& base_in_odom)
{
  worker_.put([&](Inbox& inbox) { inbox.odometry.emplace_back(stamp, base_in_odom); });
}

void HomingWorker::addMatches(double stamp, const HeadingEvidence& evidence)
{
  // One of points and one of lines: where work takes longer than the time between two, a queue would grow without end.
  constexpr std::size_t MOST = 2;
  worker_.put([&](Inbox& inbox) {
    if (inbox.matches.size() >= MOST)
    {
      inbox.matches.erase(inbox.matches.begin());
    }
    inbox.matches.emplace_back(stamp, evidence);
  });
}

void HomingWorker::addFrame(const CameraFrame& frame)
{
  worker_.put([&](Inbox& inbox) {
    inbox.frame = frame;
    inbox.frame_time = std::chrono::steady_clock::now();
  });
}

void HomingWorker::work(const Inbox& inbox)
{
  task_ = inbox.task.value_or(task_);
  if (!task_)
  {
    if (inbox.frame)
    {
      on_idle_frame_(*inbox.frame);
    }
    return;
  }
  HomingOutcome outcome;
  outcome.task = task_;
  outcome.fault = guarded("work on an image", [&] { add(inbox, *task_->homing); });
  outcome.report = task_->homing->report();
  outcome.course = task_->homing->course();
  if (inbox.frame)
  {
    outcome.frame_time = inbox.frame_time;
  }
  on_outcome_(outcome);
}

void HomingWorker::add(const Inbox& inbox, Homing& homing) const
{
  for (const auto& [stamp, pose] : inbox.odometry)
  {
    homing.addOdometry(stamp, pose);
  }
  for (const auto& [stamp, evidence] : inbox.matches)
  {
    homing.addMatches(stamp, evidence.pairs, evidence.weights);
  }
  if (inbox.frame)
  {
    homing.addImage(inbox.frame->image->header.stamp.toSec(), toGrey(*inbox.frame->image, image_topic_));
  }
}

}  // namespace view_servo
