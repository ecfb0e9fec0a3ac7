// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/transform_source.h"

#include <nav_msgs/Odometry.h>
#include <ros/message_event.h>
#include <ros/time.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>

namespace view_servo
{
/** Odometry that can be used. */
struct OdometryReading
{
  DriverInput::Stamp place;  ///< NEWEST or LATE
  double time;               ///< when the base was there, by the images' clock if `~odometry_delay` is right [s]
  PlanarPose pose;           ///< of `~base_frame` in odometry's frame
};

/**
 * Reads a base's odometry: of one publisher, of `~base_frame` or of a frame that tf places on it, with stamps that are
 * corrected by `~odometry_delay`. What cannot be used is rejected, with the reason. The caller sees to it that one
 * thread at a time uses it.
 */
class OdometryReader
{
public:
  /**
   * @param input accepts or rejects each message. @param base_frame tf frame whose pose is read.
   * @param delay by which odometry's stamps are later than those of images of the same moment [s].
   * References to `input` and `transforms` are kept, which must outlive the reader.
   */
  OdometryReader(DriverInput& input, const TransformSource& transforms, std::string base_frame, double delay);

  /** A message as it has come. */
  using Event = ros::MessageEvent<const nav_msgs::Odometry>;

  /** @return empty when the message was rejected. */
  std::optional<OdometryReading> read(const Event& event);

  const DriverInput& input() const
  {
    return input_;
  }

  /** The frame that odometry's poses are in; empty until one has come. */
  const std::string& frame() const
  {
    return frame_;
  }

  /**
   * Takes what was measured, for measuredDelay() and adviceOnDelay(); readings stay as they are.
   * @param delay by which odometry's stamps are later than those of images of the same moment, after the correction by
   * `~odometry_delay` [s]; NaN: not known.
   */
  void setRemainingDelay(double delay);
  /**
   * How much later than images odometry is stamped in all, `~odometry_delay` included [s]; NaN while that is not known.
   */
  double measuredDelay() const
  {
    return measured_delay_;
  }
  /** What to do against a delay that is too large to be ignored; empty: nothing. */
  std::string adviceOnDelay() const;

private:
  using Clock = std::chrono::steady_clock;

  /**
   * Number of nodes that have published lately, this one included. roscpp is not asked: its answer waits while it talks
   * to the master, which may take for ever.
   */
  std::size_t countPublishers(const std::string& publisher);
  std::string faultOf(const nav_msgs::Odometry& message, const PlanarPose& pose, std::size_t publishers);

  DriverInput& input_;
  const TransformSource& transforms_;
  const std::string base_frame_;
  const double delay_;
  double measured_delay_ = std::numeric_limits<double>::quiet_NaN();
  std::map<std::string, Clock::time_point> publishers_;  // by name, and when they were heard last
  std::string frame_;
  std::string child_frame_;                  // the frame whose pose odometry gives
  std::optional<PlanarPose> base_in_child_;  // pose of ~base_frame in child_frame_; empty until tf knows it
};

/** A driver's odometry, on `odom`. Used with the node's mutex held. */
class OdometryInput : public OdometryReader
{
public:
  /**
   * @param timeout the robot stands still after so long without odometry [s]. @param delay as for OdometryReader.
   * @param on_message is called with each message, by runLocked(), and has to call read().
   */
  OdometryInput(DriverContext& context, const TransformSource& transforms, const std::string& base_frame,
                double timeout, double delay, const std::function<void(const Event&)>& on_message);
};

}  // namespace view_servo
