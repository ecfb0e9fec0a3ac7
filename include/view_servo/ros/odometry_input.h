// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/transform_source.h"

#include <nav_msgs/Odometry.h>
#include <ros/subscriber.h>
#include <ros/time.h>

#include <functional>
#include <limits>
#include <optional>
#include <string>

namespace view_servo
{
/** Odometry that can be used. */
struct OdometryReading
{
  DriverInput::Stamp place;
  double time;      ///< of the images' clock, as far as `~odometry_delay` is right [s]
  PlanarPose pose;  ///< of `~base_frame` in odometry's frame
};

/**
 * A base's odometry on `odom`: of one publisher, of `~base_frame` or of a frame that tf places on it, with stamps that are
 * corrected by `~odometry_delay`. What cannot be used is rejected, with the reason. Used with the node's mutex held.
 */
class OdometryInput
{
public:
  /** @param on_message is called with what comes, by runLocked(); it shall call read(). */
  OdometryInput(DriverContext& context, const TransformSource& transforms, const std::string& base_frame,
                double timeout, double delay, const std::function<void(const nav_msgs::Odometry&)>& on_message);

  /** @return empty when the message was rejected. */
  std::optional<OdometryReading> read(const nav_msgs::Odometry& message);

  const DriverInput& input() const
  {
    return input_;
  }

  /** Takes what remains of the delay after `~odometry_delay`, see ClockOffset [s]; NaN: not known. */
  void setRemainingDelay(double delay);
  /** How much later than images odometry is stamped; NaN while that is not known [s]. */
  double measuredDelay() const
  {
    return measured_delay_;
  }
  /** What to do against a delay that is too large to be ignored; empty: nothing. */
  std::string adviceOnDelay() const;

private:
  std::string faultOf(const nav_msgs::Odometry& message, const PlanarPose& pose);

  DriverInput& input_;
  const TransformSource& transforms_;
  const std::string base_frame_;
  const double delay_;
  double measured_delay_ = std::numeric_limits<double>::quiet_NaN();
  std::string child_frame_;                  // whose pose odometry is
  std::optional<PlanarPose> base_in_child_;  // of ~base_frame in that frame
  ros::Subscriber subscriber_;
};

}  // namespace view_servo
