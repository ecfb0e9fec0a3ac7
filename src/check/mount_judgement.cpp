// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/numbers.h"

#include "check/judgements.h"

#include <algorithm>
#include <cmath>

namespace view_servo::check
{
namespace
{
std::string degrees(double angle)
{
  return number(angle / DEGREE, 0) + " degrees";
}

Finding judgeFrame(const MountObservations& mount, bool is_arm)
{
  const std::string name = "camera frame";
  if (mount.camera_frame.empty())
  {
    return error(name, "images have an empty frame_id", "let the camera's driver name its optical frame (frame_id)");
  }
  const std::string found = "'" + mount.camera_frame + "'";
  // How a base's camera is mounted tells more than its name.
  if (is_arm && mount.camera_frame.find("optical") == std::string::npos)
  {
    return warning(
        name, found + " is not called an optical frame",
        "z has to point out of the lens, x to the right and y down in the picture (REP 103): let frame_id name "
        "that frame");
  }
  return ok(name, found);
}

/** Between the base and the camera, in words. */
std::string between(const MountObservations& mount)
{
  return "'" + mount.base_frame + "' to '" + mount.camera_frame + "'";
}

Finding judgeTf(const MountObservations& mount, bool is_arm)
{
  constexpr double OLD = 1.0;  // [s]
  const std::string name = "tf";
  if (!mount.fault.empty())
  {
    return error(
        name, mount.fault,
        is_arm ? "publish the arm's tf (robot_state_publisher) and the camera's place in the hand, or set odom_frame:="
               : "publish where the camera is on the base (static_transform_publisher), or set base_frame:=");
  }
  if (mount.is_static && is_arm)
  {
    return error(name, between(mount) + " is static: by tf the camera does not move when the arm does",
                 "let the hand-eye calibration's parent be the flange, or set odom_frame:= to the arm's base");
  }
  if (mount.is_static)
  {
    return ok(name, between(mount) + ", static");
  }
  const std::string found = between(mount) + ", the newest is " + shortTime(mount.age) + " old";
  if (mount.age > OLD)
  {
    const std::string remedy = "find out why who publishes it has stopped; what never moves belongs on /tf_static";
    return is_arm ? error(name, found, remedy) : warning(name, found, remedy);
  }
  if (is_arm && !mount.fault_at_images.empty())
  {
    return error(name, mount.fault_at_images,
                 "publish the arm's tf at least as often as images come, stamped by the same clock");
  }
  return ok(name, found);
}

/** How the optical axis is turned against the base, in words. @param axis in the base's frame. */
std::string lookOf(const Eigen::Vector3d& axis)
{
  constexpr double STRAIGHT = 10.0 * DEGREE;
  const double yaw = std::atan2(axis.y(), axis.x());
  const double pitch = std::asin(std::clamp(axis.z(), -1.0, 1.0));
  std::string words = "it looks ";
  words += std::abs(yaw) < STRAIGHT          ? "ahead"
           : std::abs(yaw) > M_PI - STRAIGHT ? "back"
                                             : degrees(std::abs(yaw)) + (yaw > 0.0 ? " to the left" : " to the right");
  return words +
         (std::abs(pitch) < 0.5 * DEGREE ? "" : ", " + degrees(std::abs(pitch)) + (pitch < 0.0 ? " down" : " up"));
}

Finding judgePose(const MountObservations& mount)
{
  constexpr double TILTED = 15.0 * DEGREE;
  constexpr double UPSIDE_DOWN = 150.0 * DEGREE;
  const std::string name = "camera mount";
  const Eigen::Matrix3d rotation = mount.base_from_camera.linear();
  if (!mount.mount_fault.empty())
  {
    const bool body = rotation.col(2).z() > 0.5;
    return error(
        name,
        mount.mount_fault + ", by tf of '" + mount.camera_frame + "'" +
            (body ? ": its z axis points up, as that of a frame that is not optical" : ""),
        body ? "let frame_id name the optical frame: z out of the lens, x right and y down in the picture (REP 103)"
             : "correct the transform; homing needs a camera that looks along the floor");
  }
  const double roll = std::atan2(rotation.col(0).z(), -rotation.col(1).z());
  const Eigen::Vector3d place = mount.base_from_camera.translation();
  const std::string found = lookOf(rotation.col(2)) + ", " + number(place.z(), 2) + " m up and " +
                            number(place.x(), 2) + " m ahead of '" + mount.base_frame + "'";
  if (std::abs(roll) > UPSIDE_DOWN)
  {
    return warning(
        name, "upside down by tf; " + found,
        "turn the camera's frame by 180 degrees about its z axis, unless the camera hangs like that: then all is well");
  }
  if (std::abs(roll) > TILTED)
  {
    return warning(name, "rolled by " + degrees(roll) + " by tf; " + found,
                   "correct the camera's frame, unless the camera is mounted like that");
  }
  return ok(name, found);
}

}  // namespace

Findings judgeMount(const MountObservations& mount, bool is_arm)
{
  Findings findings = { judgeFrame(mount, is_arm) };
  if (mount.camera_frame.empty() || mount.base_frame.empty())
  {
    return findings;
  }
  findings.push_back(judgeTf(mount, is_arm));
  if (mount.fault.empty() && !is_arm)
  {
    findings.push_back(judgePose(mount));
  }
  return findings;
}

}  // namespace view_servo::check
