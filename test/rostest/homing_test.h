// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "driver_cases.h"
#include "sim/nomad.h"
#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "sim_ros/robot_messages.h"
#include "support/matched_views.h"
#include "support/shipped_files.h"

#include "test_paths.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/geometry/planar_pose.h"

#include <geometry_msgs/Twist.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** What there is to see, drawn once: the view, and what a base sees that stands 0.8 m before it. */
struct Scene
{
  sim::World world;
  cv::Mat view;
  cv::Mat image;
  PlanarPose base;
  std::vector<PointMatch> matches;

  Scene() : world(sim::readWorld(worldFile("desk")))
  {
    sim::SimulatedCamera camera(world, {}, 1);
    sim::Nomad nomad(world, sim::NomadParams());
    view = camera.capture(nomad.cameraPose());
    base = { -0.8, 0.2, 0.05 };
    nomad.setPose(sim::planarPose(base.x, base.y, base.yaw));
    image = camera.capture(nomad.cameraPose());
    matches = toPointMatches(matchPoints(PointViewMatcherParams(), view, image).matches);
  }
};

inline const Scene& scene()
{
  static const Scene made;
  return made;
}

/** A base on a stand, with a camera and a matcher: its wheels turn as they are told, what it sees does not change. */
class FakeBase : public FakeRobot
{
public:
  using Action = HomeToViewAction;
  using Command = geometry_msgs::Twist;
  static constexpr const char* NAMESPACE = "driving";
  static constexpr const char* DRIVER = "homing";
  static constexpr const char* ACTION = "home";
  static constexpr const char* SILENT = "no matches";
  static std::vector<std::string> program()
  {
    return { HOMING_PATH, "_check_motion:=false" };
  }

  explicit FakeBase(const std::string& ns) : FakeRobot(ns, DRIVER)
  {
    images_ = nh_.advertise<sensor_msgs::Image>("image_raw", 2);
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 2);
    odometry_ = nh_.advertise<nav_msgs::Odometry>("odom", 10);
    lines_ = nh_.advertise<LineMatches>("line_matches", 2);
    reconnect();
    focal_length = scene().world.camera.k(0, 0);
    broadcaster_.sendTransform(
        sim::toTransform(scene().world.camera_on_base, sim::BASE_FRAME, sim::CAMERA_FRAME, ros::Time::now()));
    start(RATE, [this](int cycle) { publish(cycle); });
  }
  ~FakeBase() override
  {
    stop();
  }

  void obey(const CommandsOf<Command>& commands)
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    commands_ = &commands;
  }

  /** No matches come, nor are the view's points to be seen: one of both would do. */
  void hush(bool silent) override
  {
    FakeRobot::hush(silent);
    elsewhere_ = silent;
  }

  /** The matcher goes, with all its connections, and comes back. */
  void reconnect()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    matches_.shutdown();
    matches_ = nh_.advertise<PointMatches>("point_matches", 2);
  }

  void publishExtremes()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    for (const ros::Time& stamp : extremeStamps())
    {
      sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, stamp);
      images_.publish(toImage(scene().image, sensor_msgs::image_encodings::MONO8, info.header));
      infos_.publish(info);
      odometry_.publish(odometry(stamp));
      matches_.publish(matches(info.header));
      LineMatches lines;
      lines.header = info.header;
      lines.view = wantedView().view;
      lines_.publish(lines);
    }
    const ros::Time now = ros::Time::now();
    for (const double number : extremeNumbers())
    {
      nav_msgs::Odometry message = odometry(now);
      message.pose.pose.position.x = number;
      message.pose.pose.orientation.w = number;
      odometry_.publish(message);
      PointMatches points = matches(sim::toCameraInfo(scene().world, 0.0, now).header);
      for (PointMatch& match : points.matches)
      {
        match.reference_x = match.current_y = match.score = number;
      }
      matches_.publish(points);
      sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, now);
      info.K[0] = info.P[0] = number;
      infos_.publish(info);
    }
    sensor_msgs::Image image =
        toImage(scene().image, sensor_msgs::image_encodings::MONO8, sim::toCameraInfo(scene().world, 0.0, now).header);
    infos_.publish(sim::toCameraInfo(scene().world, 0.0, now));
    image.data.resize(image.data.size() / 2);
    images_.publish(image);
    image.width = image.height = 0;
    image.encoding = "no such encoding";
    images_.publish(image);
  }

  /** tf learns where base_link is on another frame. */
  void placeBaseOn(const std::string& frame)
  {
    broadcaster_.sendTransform(
        sim::toTransform(Eigen::Isometry3d::Identity(), frame, sim::BASE_FRAME, ros::Time::now()));
  }

  /** Of odometry, and of images; with slashes as old nodes have them. */
  void setFrames(const std::string& odometry_child, const std::string& camera_frame)
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    odometry_child_ = odometry_child;
    camera_frame_ = camera_frame;
  }

  std::atomic<bool> infos{ true };             // publishes camera_info with each image
  std::atomic<bool> shuffles{ false };         // every third odometry message comes 0.05 s late, every 20th 0.8 s
  std::atomic<bool> moves_odometry{ true };    // publishes it
  std::atomic<double> odometry_offset{ 0.0 };  // of its stamps against the images' [s]
  std::atomic<bool> black{ false };
  std::atomic<bool> blocked{ false };  // its wheels do not turn

private:
  static constexpr double RATE = 50.0;  // of odometry [Hz]

  void publish(int cycle)
  {
    constexpr int IMAGE_EVERY = 5;
    const ros::Time time = stamp();
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    if (commands_ != nullptr && !blocked)
    {
      const Command told = commands_->newest();
      base_ = compose(base_, { told.linear.x / RATE, told.linear.y / RATE, told.angular.z / RATE });
    }
    if (moves_odometry)
    {
      const double late = !shuffles ? 0.0 : cycle % 20 == 0 ? 0.8 : cycle % 3 == 0 ? 0.05 : 0.0;
      nav_msgs::Odometry message = odometry(time.isZero() ? time : time + ros::Duration(odometry_offset - late));
      message.child_frame_id = odometry_child_;
      odometry_.publish(message);
    }
    if (cycle % IMAGE_EVERY != 0)
    {
      return;
    }
    sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, time);
    info.K[0] = info.K[4] = info.P[0] = info.P[5] = calibrated ? focal_length.load() : 0.0;
    info.header.frame_id = camera_frame_;
    if (camera)
    {
      cv::Mat image = black ? cv::Mat(scene().image.size(), CV_8UC1, cv::Scalar(0)) : scene().image;
      if (elsewhere_)
      {
        image = texturedPicture(7, image.size());
      }
      images_.publish(toImage(image, sensor_msgs::image_encodings::MONO8, info.header));
      if (infos)
      {
        infos_.publish(info);
      }
    }
    if (answers)
    {
      PointMatches message = matches(info.header);
      if (fill(message))
      {
        matches_.publish(message);
      }
      LineMatches lines;
      lines.header = info.header;
      if (refuses && fill(lines))
      {
        lines_.publish(lines);
      }
    }
  }

  PointMatches matches(const std_msgs::Header& header) const
  {
    PointMatches message;
    message.header = header;
    message.view = wantedView().view;
    message.matches = black ? std::vector<PointMatch>() : scene().matches;
    return message;
  }

  nav_msgs::Odometry odometry(const ros::Time& time) const
  {
    nav_msgs::Odometry message;
    message.header.stamp = time;
    message.header.frame_id = sim::ODOM_FRAME;
    message.child_frame_id = sim::BASE_FRAME;
    message.pose.pose = sim::toPose(sim::planarPose(base_.x, base_.y, base_.yaw));
    return message;
  }

  std::mutex publisher_mutex_;
  const CommandsOf<Command>* commands_ = nullptr;
  PlanarPose base_ = scene().base;        // by odometry
  std::atomic<bool> elsewhere_{ false };  // the camera sees something else
  std::string odometry_child_ = sim::BASE_FRAME;
  std::string camera_frame_ = sim::CAMERA_FRAME;
  ros::Publisher images_;
  ros::Publisher infos_;
  ros::Publisher odometry_;
  ros::Publisher matches_;
  ros::Publisher lines_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

/** The same base, whose driver takes it for one that cannot slide. */
class FakeDifferentialBase final : public FakeBase
{
public:
  using FakeBase::FakeBase;
  static constexpr const char* NAMESPACE = "differential";
  static std::vector<std::string> program()
  {
    return { HOMING_PATH, "_base:=differential", "_check_motion:=false" };
  }
};

}  // namespace test
}  // namespace view_servo
