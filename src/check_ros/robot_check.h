// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/finding.h"
#include "check/machine.h"
#include "check_ros/camera_listener.h"
#include "check_ros/robot_listener.h"
#include "check_ros/setup.h"
#include "view_servo/ros/transform_source.h"

#include <ros/node_handle.h>
#include <opencv2/core/mat.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace view_servo::check
{
/**
 * Listens to a robot's topics from the construction on, and says what is there and what does not fit. Publishes
 * nothing.
 */
class RobotCheck
{
public:
  RobotCheck(const ros::NodeHandle& nh, const Setup& setup);

  /**
   * Waits, by a steady clock. @param duration [s]. @param given_up asked every few milliseconds; once it is true, the
   * wait ends.
   */
  static void wait(double duration, const std::function<bool()>& given_up);

  /** Waits as wait() does, while messages come. */
  void listen(double duration, const std::function<bool()>& given_up);

  /** What is right or wrong, by what came until now. */
  Findings findings() const;

  /** The camera's newest picture with its corners and segments, BGR; empty when none came that can be read. */
  cv::Mat drawing() const;

  const ros::NodeHandle& nodeHandle() const
  {
    return nh_;
  }
  const Setup& setup() const
  {
    return setup_;
  }
  const TransformSource& transforms() const
  {
    return transforms_;
  }
  const CameraListener& camera() const
  {
    return camera_;
  }
  /** The base's odometry; null for an arm. */
  OdometryListener* odometry() const
  {
    return odometry_.get();
  }

private:
  struct ClockReading
  {
    double steady;  // time by a steady clock [s]
    double ros;     // time by ROS' clock [s]
  };

  MachineObservations observeMachine() const;

  const ros::NodeHandle nh_;
  const Setup setup_;
  const double begin_;                       // time of the construction by a steady clock [s]
  std::optional<ClockReading> clock_begin_;  // the first that listen() made; simulated time is zero until /clock comes
  ProcessorMeter processor_;
  TransformSource transforms_;
  CameraListener camera_;
  std::unique_ptr<OdometryListener> odometry_;
  std::unique_ptr<JointListener> joints_;
};

}  // namespace view_servo::check
