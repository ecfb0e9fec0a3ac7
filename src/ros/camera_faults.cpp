// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_faults.h"

#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <cmath>

namespace view_servo
{
std::string faultOf(const CameraTraffic& traffic, const CameraTopics& topics)
{
  if (traffic.images > 0 && traffic.infos == 0)
  {
    return "no camera_info comes on '" + topics.info + "', though images come on '" + topics.image + "'";
  }
  if (traffic.images == 0 && traffic.infos > 0)
  {
    return "no image comes on '" + topics.image + "', though camera_info comes on '" + topics.info + "'";
  }
  if (traffic.pairs == 0 && traffic.images > 0)
  {
    return "no image and camera_info with the same stamp: " + std::to_string(traffic.images) + " and " +
           std::to_string(traffic.infos) + " messages in " + seconds(traffic.duration) + " on " + topics.both();
  }
  return "";
}

std::string faultOf(const CameraImage& image, const sensor_msgs::CameraInfo& info, const CameraTopics& topics)
{
  const Camera camera = toCamera(info);
  const std::string fault = camera.fault();
  if (!fault.empty())
  {
    return fault + ", in " + topics.both();
  }
  if (camera.width != static_cast<int>(image.width) || camera.height != static_cast<int>(image.height))
  {
    return "the calibration is for " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
           " pixels and the image has " + std::to_string(image.width) + " x " + std::to_string(image.height) + ", in " +
           topics.both();
  }
  return "";
}

std::string faultOfAge(const ros::Time& stamp, const std::string& topic, double max_age)
{
  const double age = ageOf(stamp);
  if (std::abs(age) <= max_age)
  {
    return "";
  }
  return "the latest camera image on '" + topic + "' is " +
         (age > 0.0 ? seconds(age) + " old" : "stamped " + seconds(-age) + " in the future") + ", ~max_image_age is " +
         seconds(max_age) + remedyOfAge(age);
}

}  // namespace view_servo
