// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim_ros/robot_messages.h"
#include "support/cameras.h"
#include "support/program_run.h"
#include "test_paths.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/ros/conversions.h"

#include <geometry_msgs/PoseStamped.h>
#include <ros/time.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core/mat.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file What bags of simulated robots hold, and what their ground truth says of pairs of images. */

/**
 * Has the program record_bag write a run of a simulated robot; a failure fails the test, with what it says.
 * @param world file of the world. @param options more of the program's.
 */
inline void recordBag(const std::string& world, const std::string& trajectory, const std::string& bag,
                      const std::vector<std::string>& options = {})
{
  std::vector<std::string> arguments{ world, trajectory, bag };
  arguments.insert(arguments.end(), options.begin(), options.end());
  const ProgramRun run = runProgram(RECORD_BAG_PATH, arguments);
  ASSERT_EQ(run.status, 0) << run.err;
}

/** What a bag says of one image. */
struct Frame
{
  ros::Time stamp;
  double time;  // since the bag's start [s]
  cv::Mat image;
  Camera camera;
  Eigen::Isometry3d pose;  // world from optical frame
};

/** All images of a bag, by their stamps. */
inline std::vector<Frame> framesOf(const std::string& file)
{
  const rosbag::Bag bag(file);
  rosbag::View view(bag);
  std::map<ros::Time, Frame> frames;
  std::map<ros::Time, Eigen::Isometry3d> poses;
  for (const rosbag::MessageInstance& instance : view)
  {
    if (const auto image = instance.instantiate<sensor_msgs::Image>())
    {
      frames[image->header.stamp].image = toGrey(*image, "image");
    }
    else if (const auto info = instance.instantiate<sensor_msgs::CameraInfo>())
    {
      frames[info->header.stamp].camera = toCamera(*info);
    }
    else if (const auto truth = instance.instantiate<geometry_msgs::PoseStamped>())
    {
      poses[truth->header.stamp] = sim::toIsometry(truth->pose);
    }
  }
  std::vector<Frame> result;
  for (auto& [stamp, frame] : frames)
  {
    frame.stamp = stamp;
    frame.time = (stamp - view.getBeginTime()).toSec();
    frame.pose = poses.at(stamp);
    result.push_back(frame);
  }
  return result;
}

/** How two frames truly lie to each other. */
class TrueGeometry
{
public:
  TrueGeometry(const Frame& reference, const Frame& current)
  {
    const Eigen::Isometry3d motion = current.pose.inverse() * reference.pose;
    const Eigen::Vector3d& t = motion.translation();
    fundamental_ = fundamentalOf(reference.camera.k, current.camera.k, motion.linear(), t);
    far_away_ = current.camera.k * motion.linear() * reference.camera.k.inverse();
    constexpr double NO_MOTION = 1e-3;  // [m]; then all points move as those far away
    moved_ = t.norm() > NO_MOTION;
  }

  /** Distance of a pair from what is possible [px]. */
  double error(const Correspondence& pair) const
  {
    return moved_ ? std::sqrt(sampsonError(fundamental_, pair))
                  : (transfer(far_away_, pair.reference) - pair.current).norm();
  }

private:
  Eigen::Matrix3d fundamental_;
  Eigen::Matrix3d far_away_;
  bool moved_;
};

}  // namespace test
}  // namespace view_servo
