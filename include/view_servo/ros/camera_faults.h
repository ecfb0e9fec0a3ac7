// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/camera_image.h"

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>

#include <string>

namespace view_servo
{
/** @file
 * Why a camera's messages cannot be used, in one line each; empty when they can. Nodes and check_robot say the same.
 */

/** Names of a camera's topics as other nodes see them. */
struct CameraTopics
{
  std::string image;  ///< topic of the images
  std::string info;   ///< topic of camera_info

  /** Both in quotation marks, for messages. */
  std::string both() const
  {
    return "'" + image + "' and '" + info + "'";
  }
};

/** How many messages came on a camera's topics. */
struct CameraTraffic
{
  int images = 0;         ///< messages on the topic of images
  int infos = 0;          ///< messages on the topic of camera_info
  int pairs = 0;          ///< pairs of an image and a camera_info with the same stamp
  double duration = 0.0;  ///< length of the time in which they came [s]
};

/** What is wrong with the numbers of messages that came; nothing when none came at all. */
std::string faultOf(const CameraTraffic& traffic, const CameraTopics& topics);

/** What is wrong with an image and the camera_info of the same stamp: with calibration or sizes. */
std::string faultOf(const CameraImage& image, const sensor_msgs::CameraInfo& info, const CameraTopics& topics);

/**
 * What is wrong with an image's age. One from the future is as bad as an old one: time jumped back, as when a bag loops.
 * @param topic of the image. @param max_age as `~max_image_age` [s].
 */
std::string faultOfAge(const ros::Time& stamp, const std::string& topic, double max_age);

}  // namespace view_servo
