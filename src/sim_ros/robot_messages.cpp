// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/robot_messages.h"

#include "view_servo/ros/conversions.h"

#include <cmath>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
std_msgs::Header header(const std::string& frame, const ros::Time& stamp)
{
  std_msgs::Header result;
  result.frame_id = frame;
  result.stamp = stamp;
  return result;
}

}  // namespace

FrameNames::FrameNames(const std::string& prefix)
{
  const std::size_t begin = prefix.find_first_not_of('/');
  if (begin != std::string::npos)
  {
    prefix_ = prefix.substr(begin, prefix.find_last_not_of('/') + 1 - begin) + "/";
  }
}

geometry_msgs::TransformStamped FrameNames::operator()(geometry_msgs::TransformStamped transform) const
{
  transform.header.frame_id = (*this)(transform.header.frame_id);
  transform.child_frame_id = (*this)(transform.child_frame_id);
  return transform;
}

nav_msgs::Odometry FrameNames::operator()(nav_msgs::Odometry odometry) const
{
  odometry.header.frame_id = (*this)(odometry.header.frame_id);
  odometry.child_frame_id = (*this)(odometry.child_frame_id);
  return odometry;
}

geometry_msgs::Pose toPose(const Eigen::Isometry3d& pose)
{
  geometry_msgs::Pose message;
  message.position.x = pose.translation().x();
  message.position.y = pose.translation().y();
  message.position.z = pose.translation().z();
  message.orientation = toMessage(Eigen::Quaterniond(pose.linear()));
  return message;
}

Eigen::Isometry3d toIsometry(const geometry_msgs::Pose& pose)
{
  const Eigen::Quaterniond q(pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z);
  const Eigen::Vector3d position(pose.position.x, pose.position.y, pose.position.z);
  constexpr double TOLERANCE = 0.01;
  if (!position.allFinite() || !(std::abs(q.norm() - 1.0) < TOLERANCE))
  {
    throw std::invalid_argument("the pose is not finite, or its quaternion is not of length 1");
  }
  Eigen::Isometry3d result(q.normalized());
  result.translation() = position;
  return result;
}

geometry_msgs::TransformStamped toTransform(const Eigen::Isometry3d& pose, const std::string& parent,
                                            const std::string& child, const ros::Time& stamp)
{
  const geometry_msgs::Pose values = toPose(pose);
  geometry_msgs::TransformStamped message;
  message.header = header(parent, stamp);
  message.child_frame_id = child;
  message.transform.translation.x = values.position.x;
  message.transform.translation.y = values.position.y;
  message.transform.translation.z = values.position.z;
  message.transform.rotation = values.orientation;
  return message;
}

geometry_msgs::PoseStamped toGroundTruth(const Eigen::Isometry3d& camera, const ros::Time& stamp)
{
  geometry_msgs::PoseStamped message;
  message.header = header(WORLD_FRAME, stamp);
  message.pose = toPose(camera);
  return message;
}

nav_msgs::Odometry toOdometry(const Nomad& nomad, const ros::Time& stamp)
{
  nav_msgs::Odometry message;
  message.header = header(ODOM_FRAME, stamp);
  message.child_frame_id = BASE_FRAME;
  message.pose.pose = toPose(nomad.odometry());
  message.twist.twist.linear.x = nomad.measuredVelocity().x();
  message.twist.twist.linear.y = nomad.measuredVelocity().y();
  message.twist.twist.angular.z = nomad.measuredVelocity().z();
  return message;
}

sensor_msgs::JointState toJointState(const Puma& puma, const Puma::Joints& measured, const ros::Time& stamp)
{
  sensor_msgs::JointState message;
  message.header.stamp = stamp;
  message.name = puma.jointNames();
  message.position.assign(measured.data(), measured.data() + measured.size());
  message.velocity.assign(puma.velocities().data(), puma.velocities().data() + puma.velocities().size());
  return message;
}

sensor_msgs::CameraInfo toCameraInfo(const World& world, double focal_length_error, const ros::Time& stamp)
{
  return view_servo::toCameraInfo(withFocalLengthError(world.camera, focal_length_error), header(CAMERA_FRAME, stamp));
}

}  // namespace view_servo::sim
