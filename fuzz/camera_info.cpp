// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"
#include "message.h"

#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/conversions.h"

#include <sensor_msgs/CameraInfo.h>

#include <exception>

using namespace view_servo;

/** A CameraInfo as it comes over the network. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  const auto info = fuzz::received<sensor_msgs::CameraInfo>(data, size);
  if (!info)
  {
    return 0;
  }
  const Camera camera = toCamera(*info);
  const std::string fault = camera.fault();
  if (!fault.empty())
  {
    fuzz::requireReason(fault);
    return 0;
  }
  constexpr int LARGEST = 64;  // maps of larger images would take most of the time [px]
  if (camera.width <= LARGEST && camera.height <= LARGEST)
  {
    fuzz::readOrRefuse<std::exception>([&] { CameraWarp(camera, camera.rectified()); });
  }
  return 0;
}
