// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/geometry/camera_warp.h"
#include "view_servo/ros/conversions.h"

#include <ros/serialization.h>
#include <sensor_msgs/CameraInfo.h>

#include <exception>
#include <vector>

using namespace view_servo;

namespace
{
/** Whether the coefficients are not more than the bytes can hold: roscpp makes room for as many as the message says. */
bool holdsItsCoefficients(const std::vector<std::uint8_t>& bytes)
{
  std::size_t at = 12;  // after the header's numbers
  const auto number = [&] {
    std::uint32_t value = 0;
    if (at + sizeof(value) <= bytes.size())
    {
      std::memcpy(&value, bytes.data() + at, sizeof(value));
    }
    at += sizeof(value);
    return std::size_t{ value };
  };
  at += number();  // the frame
  at += 8;         // the size
  at += number();  // the model
  const std::size_t count = number();
  return count * sizeof(double) <= bytes.size();
}
}  // namespace

/** A CameraInfo as it comes over the network. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  if (size == 0)
  {
    return 0;  // roscpp steps over a null pointer then, which UndefinedBehaviorSanitizer sees
  }
  std::vector<std::uint8_t> bytes(data, data + size);
  if (!holdsItsCoefficients(bytes))
  {
    return 0;
  }
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
