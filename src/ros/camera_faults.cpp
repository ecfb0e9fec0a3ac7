// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_faults.h"

#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace
{
constexpr double LONG = 0.15;  // until it counts that messages come without others [s]

/** Of CameraTraffic::images_ahead; empty when it is unknown or says nothing. */
std::string apart(double images_ahead)
{
  if (std::isnan(images_ahead) || images_ahead == 0.0)
  {
    return "";
  }
  return ", the newest image is stamped " + seconds(std::abs(images_ahead)) +
         (images_ahead < 0.0 ? " before" : " after") + " the newest camera_info";
}

}  // namespace

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
           std::to_string(traffic.infos) + " messages in " + seconds(traffic.duration) + " on " + topics.both() +
           apart(traffic.images_ahead);
  }
  return "";
}

bool PairingWatch::Alone::add(double time)
{
  // A calibration may come after its image. What waits while a frame is worked on comes all at once, and images first.
  constexpr int OFTEN = 5;
  since = count == 0 ? time : since;
  ++count;
  return count >= OFTEN && time - since >= LONG;
}

std::optional<CameraTraffic> PairingWatch::addImage(double time, const ros::Time& stamp)
{
  image_stamp_ = stamp;
  infos_alone_.count = 0;
  both_since_ = images_ == 0 && infos_ > 0 ? time : both_since_;
  ++images_;
  if (images_alone_.add(time))
  {
    infos_ = 0;  // those that came before have no part in this
    CameraTraffic traffic;
    traffic.images = images_alone_.count;
    return traffic;
  }
  return unpaired(time);
}

std::optional<CameraTraffic> PairingWatch::addInfo(double time, const ros::Time& stamp)
{
  info_stamp_ = stamp;
  images_alone_.count = 0;
  both_since_ = infos_ == 0 && images_ > 0 ? time : both_since_;
  ++infos_;
  if (infos_alone_.add(time))
  {
    images_ = 0;
  }
  return unpaired(time);
}

void PairingWatch::addPair()
{
  paired_before_ = true;
  images_ = infos_ = 0;
}

double PairingWatch::imagesAhead() const
{
  return image_stamp_.isZero() || info_stamp_.isZero() ? NOT_A_NUMBER : secondsBetween(info_stamp_, image_stamp_);
}

std::optional<CameraTraffic> PairingWatch::unpaired(double time) const
{
  constexpr int A_FEW = 3;
  const int enough = paired_before_ ? A_FEW : std::max(A_FEW, queue_size_ + 1);
  if (std::min(images_, infos_) < enough || time - both_since_ < LONG)
  {
    return std::nullopt;
  }
  return CameraTraffic{ images_, infos_, 0, time - both_since_, imagesAhead() };
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
