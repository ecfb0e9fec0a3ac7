// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/camera_image.h"

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>

#include <limits>
#include <optional>
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
  /** By how much the newest image is stamped after the newest camera_info [s]; NaN: unknown. */
  double images_ahead = std::numeric_limits<double>::quiet_NaN();
};

/** What is wrong with the numbers of messages that came; nothing when none came at all. */
std::string faultOf(const CameraTraffic& traffic, const CameraTopics& topics);

/**
 * Finds out early that images come without camera_info, or that both come and never have the same stamp. The latter is
 * certain once more have come of both than wait for each other: one kind may come later than the other all the time.
 * Where there were pairs before, a few suffice. Times are of a steady clock [s].
 */
class PairingWatch
{
public:
  /** @param queue_size how many messages of each kind wait for one of the other kind. */
  explicit PairingWatch(int queue_size) : queue_size_(queue_size)
  {
  }

  /** @return what came, when the image shows that no pairs come; else empty. */
  std::optional<CameraTraffic> addImage(double time, const ros::Time& stamp);
  /** The same for a camera_info. */
  std::optional<CameraTraffic> addInfo(double time, const ros::Time& stamp);
  /** An image and a camera_info had the same stamp. */
  void addPair();

  /** As CameraTraffic::images_ahead. */
  double imagesAhead() const;

private:
  /** Messages of one kind since the last one of the other kind. */
  struct Alone
  {
    int count = 0;
    double since = 0.0;  // when the first of them came

    /** @return whether they are too many to wait for the other kind. */
    bool add(double time);
  };

  std::optional<CameraTraffic> unpaired(double time) const;

  int queue_size_;
  bool paired_before_ = false;
  int images_ = 0;           // since the last pair
  int infos_ = 0;            // since the last pair
  double both_since_ = 0.0;  // when the first message came after which both kinds had come since the last pair
  Alone images_alone_;
  Alone infos_alone_;
  ros::Time image_stamp_;  // of the newest
  ros::Time info_stamp_;
};

/** What is wrong with an image and the camera_info of the same stamp: with calibration or sizes. */
std::string faultOf(const CameraImage& image, const sensor_msgs::CameraInfo& info, const CameraTopics& topics);

/**
 * What is wrong with an image's age. One from the future is as bad as an old one: time jumped back, as when a bag
 * loops.
 * @param topic of the image. @param max_age as `~max_image_age` [s].
 */
std::string faultOfAge(const ros::Time& stamp, const std::string& topic, double max_age);

}  // namespace view_servo
