// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/conversions.h"

#include <ros/serialization.h>
#include <sensor_msgs/CameraInfo.h>

#include <stdexcept>
#include <vector>

using namespace view_servo;

/** A CameraInfo as it comes over the network. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  if (size == 0)
  {
    return 0;  // roscpp steps over a null pointer then, which UndefinedBehaviorSanitizer sees
  }
  std::vector<std::uint8_t> bytes(data, data + size);
  sensor_msgs::CameraInfo info;
  try
  {
    ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(size));
    ros::serialization::deserialize(stream, info);
  }
  catch (const ros::serialization::StreamOverrunException&)
  {
    return 0;  // roscpp does not hand on what ends too early
  }
  catch (const std::length_error&)
  {
    return 0;
  }
  catch (const std::bad_alloc&)
  {
    return 0;
  }
  const Camera camera = toCamera(info);
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
