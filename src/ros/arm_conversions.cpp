// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/arm_conversions.h"

#include "view_servo/ServoStatus.h"
#include "view_servo/geometry/camera_warp.h"
#include "view_servo/geometry/region.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/transform_source.h"

#include <ros/console.h>
#include <urdf_parser/urdf_parser.h>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace view_servo
{
namespace
{
std::uint8_t toStatusState(ServoState state)
{
  switch (state)
  {
    case ServoState::ACQUIRING:
      return ServoStatus::ACQUIRING;
    case ServoState::LOST:
      return ServoStatus::LOST;
    case ServoState::CONVERGED:
      return ServoStatus::CONVERGED;
    case ServoState::FAILED:
      return ServoStatus::ABORTED;
    default:
      return ServoStatus::SERVOING;
  }
}

}  // namespace

ServoTarget servoTargetOf(const StoredView& view, const Camera& camera)
{
  const CameraWarp warp(cameraOf(view, camera), camera.rectified());
  const cv::Rect region = view.region.empty() ? cv::Rect(cv::Point(), view.image.size()) : view.region;
  const Eigen::Vector2d middle = warp.point(middleOf(region));
  if (!middle.allFinite())
  {
    throw std::runtime_error("this camera cannot show the middle of the region of view '" + view.name + "'");
  }
  return { warp.to().k, { warp.size().width, warp.size().height }, middle };
}

PlaneView toPlaneView(const Homography& message)
{
  constexpr double TOLERANCE = 0.01;
  constexpr double FARTHEST = 100.0;          // t / d [1]
  constexpr double SMALLEST_DISTANCE = 1e-3;  // [m]
  constexpr double LARGEST_DISTANCE = 1e3;
  const Eigen::Quaterniond rotation(message.rotation.w, message.rotation.x, message.rotation.y, message.rotation.z);
  PlaneView view;
  view.stamp = message.header.stamp.toSec();
  view.inliers = message.inliers;
  view.motion.rotation = rotation.normalized().toRotationMatrix();
  view.motion.translation_over_distance = toVector(message.translation_over_distance);
  view.motion.normal = toVector(message.normal);
  if (std::isnan(message.normal.z))
  {
    view.motion.normal = Eigen::Vector3d::UnitZ();  // not known yet; the tracker takes the same
  }
  if (!std::isnan(message.distance))
  {
    view.distance = message.distance;
  }
  const auto require = [](bool holds, const std::string& fault) {
    if (!holds)
    {
      throw std::runtime_error(fault);
    }
  };
  require(std::abs(rotation.norm() - 1.0) < TOLERANCE, "its rotation is no unit quaternion");
  require(view.motion.translation_over_distance.norm() <= FARTHEST, "its t / d is not within 100");
  require(std::abs(view.motion.normal.norm() - 1.0) < TOLERANCE, "its normal is no unit vector");
  require(!view.distance || (*view.distance >= SMALLEST_DISTANCE && *view.distance <= LARGEST_DISTANCE),
          "its distance is not within 0.001 m and 1000 m");
  require(view.inliers >= 0, "its inliers are negative");
  return view;
}

ServoError toServoError(const ServoReport& report, const ServoTarget& target, bool distance_known,
                        const std_msgs::Header& header)
{
  ServoError message;
  message.header = header;
  message.state = toStatusState(report.state);
  const bool known = report.error && (report.state == ServoState::SERVOING || report.state == ServoState::CONVERGED);
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(NOT_A_NUMBER);
  message.point_x = known ? report.point.x() : NOT_A_NUMBER;
  message.point_y = known ? report.point.y() : NOT_A_NUMBER;
  message.wanted_x = target.point.x();
  message.wanted_y = target.point.y();
  message.error_x = known ? report.error->point.x() : NOT_A_NUMBER;
  message.error_y = known ? report.error->point.y() : NOT_A_NUMBER;
  message.log_depth = known ? report.error->depth : NOT_A_NUMBER;
  message.rotation = toMessage(known ? report.error->rotation : unknown);
  message.gain_x = known ? report.gains.x() : NOT_A_NUMBER;
  message.gain_y = known ? report.gains.y() : NOT_A_NUMBER;
  message.translation_error = known && distance_known ? report.translation_error : NOT_A_NUMBER;
  message.rotation_error = known ? report.rotation_error : NOT_A_NUMBER;
  return message;
}

std::map<std::string, JointLimits> jointLimits(const std::string& urdf_xml)
{
  std::map<std::string, JointLimits> limits;
  if (urdf_xml.empty())
  {
    return limits;
  }
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(urdf_xml);
  if (!model)
  {
    ROS_WARN("robot_description is no URDF: joint limits are not watched");
    return limits;
  }
  for (const auto& [name, joint] : model->joints_)
  {
    if (joint->limits && (joint->type == urdf::Joint::REVOLUTE || joint->type == urdf::Joint::PRISMATIC))
    {
      limits[name] = { joint->limits->lower, joint->limits->upper };
    }
  }
  return limits;
}

std::set<std::string> jointsMoving(const std::string& urdf_xml, const std::string& frame)
{
  std::set<std::string> names;
  const urdf::ModelInterfaceSharedPtr model = urdf_xml.empty() ? nullptr : urdf::parseURDF(urdf_xml);
  if (!model)
  {
    return names;
  }
  urdf::LinkConstSharedPtr link = model->getLink(withoutSlash(frame));
  link = link ? link : model->getLink(frame.substr(frame.rfind('/') + 1));
  for (; link && link->parent_joint; link = link->getParent())
  {
    if (link->parent_joint->type != urdf::Joint::FIXED)
    {
      names.insert(link->parent_joint->name);
    }
  }
  return names;
}

std::string robotDescription(const ros::NodeHandle& nh)
{
  std::string key;
  std::string text;
  if (nh.searchParam("robot_description", key))
  {
    nh.getParam(key, text);
  }
  return text;
}

namespace
{
/** Joints of a URDF that are not fixed. @param mimicking whether those that mimic others, or those that do not. */
std::set<std::string> jointsThatMove(const std::string& urdf_xml, bool mimicking)
{
  std::set<std::string> names;
  const urdf::ModelInterfaceSharedPtr model = urdf_xml.empty() ? nullptr : urdf::parseURDF(urdf_xml);
  if (model)
  {
    for (const auto& [name, joint] : model->joints_)
    {
      if (joint->type != urdf::Joint::FIXED && (joint->mimic != nullptr) == mimicking)
      {
        names.insert(name);
      }
    }
  }
  return names;
}

}  // namespace

std::set<std::string> movableJoints(const std::string& urdf_xml)
{
  return jointsThatMove(urdf_xml, false);
}

std::set<std::string> mimicJoints(const std::string& urdf_xml)
{
  return jointsThatMove(urdf_xml, true);
}

}  // namespace view_servo
