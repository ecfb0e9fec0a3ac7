// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/observations.h"
#include "check/stream_meter.h"
#include "check_ros/camera_listener.h"
#include "check_ros/setup.h"
#include "view_servo/control/clock_offset.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/odometry_history.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/odometry_input.h"
#include "view_servo/ros/ros_graph.h"
#include "view_servo/ros/transform_source.h"

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <sensor_msgs/JointState.h>

#include <mutex>
#include <optional>
#include <set>
#include <string>

namespace view_servo::check
{
/** Listens to a base's odometry, and judges it as homing does. Safe to use from several threads. */
class OdometryListener
{
public:
  /** The references are kept. @param delay as `~odometry_delay` [s]. */
  OdometryListener(const ros::NodeHandle& nh, const Setup& setup, const TransformSource& transforms,
                   const CameraListener& camera, double delay);

  OdometryObservations observations(const RosGraph& graph) const;

  /** Pose of `base_frame` in odometry's frame; empty where nothing is known. @param stamp of an image [s]. */
  std::optional<PlanarPose> at(double stamp) const;
  /** The newest pose of `base_frame` in odometry's frame; empty before the first. */
  std::optional<PlanarPose> newest() const;
  /** Time since the last odometry that could be used came [s]; infinite before the first. */
  double silence() const;
  /** What odometry said of the base's turns in the last seconds. */
  ClockOffset clocks() const;
  /** What to do when odometry is stamped by `remaining` [s] later than images, see OdometryReader; empty: nothing. */
  std::string adviceOn(double remaining);

private:
  void onOdometry(const OdometryReader::Event& event);
  /** Compares the newest stamps of odometry and images. The mutex is held. */
  void compareClocks();

  const CameraListener& camera_;
  const std::string topic_;
  const double delay_;
  mutable std::mutex mutex_;  // guards what follows
  DriverInput input_;
  DriverInput stamps_;  // of all messages, also those that are rejected for what is in them
  OdometryReader reader_;
  StreamMeter meter_;
  RestMeter rest_;
  OdometryHistory history_;
  ClockOffset clocks_;
  std::string frame_;
  std::string child_frame_;
  std::string fault_;        // of the last message
  std::string stamp_fault_;  // likewise
  std::string apart_fault_;
  int compared_images_ = 0;  // that had come at the last comparison with them
  int comparisons_ = 0;      // of stamps with those of images
  int apart_ = 0;            // comparisons that stampsApart() objected to
  double last_time_;         // when usable odometry came last, by a steady clock [s]
  ros::Subscriber subscriber_;
};

/** Listens to an arm's joints, and judges them as servo_25d does. Safe to use from several threads. */
class JointListener
{
public:
  JointListener(const ros::NodeHandle& nh, const Setup& setup);

  JointObservations observations(const RosGraph& graph) const;

private:
  void onJoints(const sensor_msgs::JointState& message);

  const std::string topic_;
  const std::set<std::string> described_;  // joints of robot_description that move by themselves
  const std::set<std::string> following_;  // those that mimic others, whose states may come or not
  mutable std::mutex mutex_;               // guards what follows
  JointGuard guard_;
  StreamMeter meter_;
  std::set<std::string> names_;  // joints that messages have named
  std::string fault_;            // of the last message
  ros::Subscriber subscriber_;
};

/** Where tf has the camera, asked as homing and homography_tracker ask. */
MountObservations observeMount(const Setup& setup, const TransformSource& transforms, const CameraListener& camera);

/** Who listens to commands. */
CommandObservations observeCommands(const ros::NodeHandle& nh, const Setup& setup, const RosGraph& graph);

}  // namespace view_servo::check
