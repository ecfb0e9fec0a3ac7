// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check_ros/robot_check.h"

#include "check/judgements.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/ros_graph.h"

#include <ros/time.h>

#include <algorithm>
#include <chrono>
#include <thread>

namespace view_servo::check
{
RobotCheck::RobotCheck(const ros::NodeHandle& nh, const Setup& setup)
  : nh_(nh), setup_(setup), begin_(steadySeconds()), camera_(nh, setup)
{
  if (setup.is_arm)
  {
    joints_ = std::make_unique<JointListener>(nh, setup);
    return;
  }
  const double delay = nh.param("homing/odometry_delay", 0.0);  // of homing, where it runs
  odometry_ = std::make_unique<OdometryListener>(nh, setup, transforms_, camera_, delay);
}

void RobotCheck::wait(double duration, const std::function<bool()>& given_up)
{
  const std::chrono::milliseconds poll(10);
  const double end = steadySeconds() + duration;
  while (steadySeconds() < end && !given_up())
  {
    std::this_thread::sleep_for(poll);
  }
}

void RobotCheck::listen(double duration, const std::function<bool()>& given_up)
{
  wait(duration, [&] {
    if (const ros::Time now = ros::Time::now(); !clock_begin_ && !now.isZero())
    {
      clock_begin_ = ClockReading{ steadySeconds(), now.toSec() };
    }
    return given_up();
  });
}

MachineObservations RobotCheck::observeMachine() const
{
  MachineObservations machine;
  machine.sim_time = ros::Time::isSimTime();
  machine.clock_rate = clock_begin_ ? (ros::Time::now().toSec() - clock_begin_->ros) /
                                          std::max(steadySeconds() - clock_begin_->steady, 1e-3)
                                    : 0.0;
  machine.cores = ProcessorMeter::cores();
  machine.cores_idle = processor_.idleCores();
  const std::filesystem::path directory = viewsDir(setup_.views_dir);
  const DiskSpace space = diskSpace(directory);
  machine.views_dir = directory.string();
  machine.disk_fault = space.fault;
  machine.disk_free = space.free;
  return machine;
}

Findings RobotCheck::findings() const
{
  MachineObservations machine = observeMachine();  // before the work on the picture
  const RosGraph graph;
  machine.clock_published = !graph.publisher("/clock").empty();
  const CameraObservations camera = camera_.observations(graph, steadySeconds() - begin_);
  Findings findings = judgeCamera(camera);
  if (camera.images.count > 0)
  {
    append(findings, judgeMount(observeMount(setup_, transforms_, camera_), setup_.is_arm));
  }
  if (odometry_)
  {
    append(findings, judgeOdometry(odometry_->observations(graph), camera.images.age));
  }
  if (joints_)
  {
    append(findings, judgeJoints(joints_->observations(graph)));
  }
  append(findings, judgeCommands(observeCommands(nh_, setup_, graph)));
  append(findings, judgeMachine(machine));
  return findings;
}

cv::Mat RobotCheck::drawing() const
{
  const cv::Mat picture = camera_.picture();
  if (picture.empty())
  {
    return {};
  }
  const PictureMeasures measures = measurePicture(picture);
  return drawPicture(picture, camera_.topics().image + ": " + std::to_string(measures.corners) + " corners (dots), " +
                                  std::to_string(measures.segments) + " segments (lines)");
}

}  // namespace view_servo::check
