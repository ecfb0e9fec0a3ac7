// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include <view_servo/ServoStatus.h>
#include <view_servo/ros/conversions.h>

/** Uses a message and the library of ROS' edge. */
int main()
{
  const view_servo::ServoStatus status;
  const view_servo::Camera camera = view_servo::toCamera(sensor_msgs::CameraInfo());
  return status.reason.empty() && !camera.fault().empty() ? 0 : 1;
}
