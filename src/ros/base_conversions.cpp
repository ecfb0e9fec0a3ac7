// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/base_conversions.h"

#include "view_servo/ros/conversions.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace view_servo
{
namespace
{
std::uint8_t toHeadingState(const HomingReport& report)
{
  if (report.at_view)
  {
    return Heading::ARRIVED;
  }
  switch (report.state)
  {
    case HomingState::NEAR:
      return Heading::NEAR;
    case HomingState::DOCKING:
    case HomingState::ARRIVED:
      return Heading::DOCKING;
    case HomingState::LOST:
    case HomingState::FAILED:
      return Heading::LOST;
    default:
      return Heading::APPROACHING;
  }
}

/** A pose on the floor. @param covariance of x, y and yaw. */
geometry_msgs::PoseWithCovarianceStamped toPoseOnFloor(const PlanarPose& pose, const Eigen::Matrix3d& covariance,
                                                       double stamp, const std::string& frame)
{
  constexpr std::size_t SIDE = 6;                         // of the message's covariance
  const std::array<std::size_t, 3> places = { 0, 1, 5 };  // of x, y and yaw in it
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = toStamp(stamp);
  message.header.frame_id = frame;
  message.pose.pose.position.x = pose.x;
  message.pose.pose.position.y = pose.y;
  message.pose.pose.orientation.z = std::sin(0.5 * pose.yaw);
  message.pose.pose.orientation.w = std::cos(0.5 * pose.yaw);
  for (std::size_t i = 0; i < places.size(); ++i)
  {
    for (std::size_t k = 0; k < places.size(); ++k)
    {
      message.pose.covariance[SIDE * places[i] + places[k]] = covariance(static_cast<int>(i), static_cast<int>(k));
    }
  }
  return message;
}
}  // namespace

PlanarPose toPlanarPose(const nav_msgs::Odometry& message)
{
  const geometry_msgs::Pose& pose = message.pose.pose;
  geometry_msgs::Transform transform;
  transform.translation.x = pose.position.x;
  transform.translation.y = pose.position.y;
  transform.rotation = pose.orientation;
  return toPlanar(toIsometry(transform));
}

geometry_msgs::TwistStamped toTwistStamped(const BaseVelocity& velocity, const ros::Time& stamp,
                                           const std::string& base_frame)
{
  geometry_msgs::TwistStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = base_frame;
  message.twist.linear.x = velocity.x();
  message.twist.linear.y = velocity.y();
  message.twist.angular.z = velocity.z();
  return message;
}

HeadingEvidence toHeadingEvidence(const std::vector<PointMatch>& matches)
{
  HeadingEvidence evidence;
  for (const PointMatch& match : matches)
  {
    if (!(match.score >= 0.0 && std::isfinite(match.score)))
    {
      continue;
    }
    evidence.pairs.push_back({ { match.reference_x, match.reference_y }, { match.current_x, match.current_y } });
    evidence.weights.push_back(match.score);
  }
  return evidence;
}

Heading toHeading(const HomingReport& report, const std::string& base_frame)
{
  Heading message;
  message.header.stamp = toStamp(report.stamp);
  message.header.frame_id = base_frame;
  message.heading = report.heading;
  message.yaw_error = report.yaw_error;
  message.confidence = report.confidence;
  message.histogram = report.histogram;
  message.roi_min = report.roi_min;
  message.roi_max = report.roi_max;
  message.similarity = report.similarity;
  message.state = toHeadingState(report);
  return message;
}

geometry_msgs::PoseWithCovarianceStamped toViewPose(const HomingReport& report, const std::string& odom_frame)
{
  return toPoseOnFloor(*report.goal_in_odom, report.goal_covariance, report.stamp, odom_frame);
}

geometry_msgs::PoseWithCovarianceStamped toBasePose(const HomingReport& report, const std::string& view)
{
  const PlanarPose goal{ report.distance * std::cos(report.heading), report.distance * std::sin(report.heading),
                         report.yaw_error };
  const PlanarPose base = inverse(goal);
  // How the base's pose at the view changes with the view's pose in odometry's frame.
  const Eigen::Rotation2Dd odom_in_view(-report.goal_in_odom->yaw);
  Eigen::Matrix3d jacobian = -Eigen::Matrix3d::Identity();
  jacobian.topLeftCorner<2, 2>() = -odom_in_view.toRotationMatrix();
  jacobian.topRightCorner<2, 1>() << base.y, -base.x;
  return toPoseOnFloor(base, jacobian * report.goal_covariance * jacobian.transpose(), report.stamp, "view_" + view);
}

geometry_msgs::PoseStamped toHeadingArrow(const HomingReport& report, const std::string& base_frame)
{
  geometry_msgs::PoseStamped arrow;
  arrow.header.stamp = toStamp(report.stamp);
  arrow.header.frame_id = base_frame;
  arrow.pose.orientation.z = std::sin(0.5 * report.heading);
  arrow.pose.orientation.w = std::cos(0.5 * report.heading);
  return arrow;
}

}  // namespace view_servo
