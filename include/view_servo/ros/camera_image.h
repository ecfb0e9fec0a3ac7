// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <image_transport/subscriber.h>
#include <message_filters/simple_filter.h>
#include <ros/message_traits.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>
#include <boost/shared_ptr.hpp>
#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <string>

namespace view_servo
{
/** A camera's image as it came; a compressed one is decoded by toGrey(), when somebody uses it. */
struct CameraImage
{
  CameraImage() = default;  // message_filters needs it
  /** @param from topic that the image came on. */
  CameraImage(const sensor_msgs::ImageConstPtr& image, const std::string& from);
  CameraImage(const sensor_msgs::CompressedImageConstPtr& image, const std::string& from);

  std_msgs::Header header;         ///< of the message: its stamp, and the camera's optical frame
  std::uint32_t width = 0;         ///< [px]; of a compressed image by the header of its data
  std::uint32_t height = 0;        ///< [px]
  std::string encoding;            ///< the message's encoding; of a compressed image its format
  std::string topic;               ///< topic that it came on, which errors name
  std::string fault;               ///< why a compressed image cannot be decoded, as far as is known; or empty
  sensor_msgs::ImageConstPtr raw;  ///< null when it came compressed
  sensor_msgs::CompressedImageConstPtr packed;  ///< null when it came raw
};

using CameraImageConstPtr = boost::shared_ptr<const CameraImage>;

/**
 * As 8-bit grey; see toGrey() of the messages. @throws ImageError, naming the topic, when it cannot be used or decoded.
 */
cv::Mat toGrey(const CameraImage& image);

/** As 8-bit BGR, for people. @throws ImageError as toGrey() does. */
cv::Mat toColour(const CameraImage& image);

/**
 * Subscribes to a camera's images. The transports are those that image_transport has installed; without a plugin for
 * "compressed", sensor_msgs/CompressedImage on TOPIC/compressed is subscribed here, and left as it is until it is used.
 */
class CameraImageSubscriber : public message_filters::SimpleFilter<CameraImage>
{
public:
  /**
   * Calls what is registered for each image from now on.
   * @param private_nh whose parameter `image_transport` is used, where there is one, and where transports have
   * parameters of their own. @param topic of raw images, before remapping. @param transport the default of that
   * parameter.
   * @throws std::invalid_argument naming the transports there are, when it is not among them.
   */
  void subscribe(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const std::string& topic,
                 const std::string& transport, int queue_size);

  /** Nothing is called any more, until it subscribes again. */
  void shutdown();

  /** Resolved name of the topic that images come on. */
  const std::string& getTopic() const
  {
    return topic_;
  }

private:
  std::string topic_;
  image_transport::Subscriber image_subscriber_;
  ros::Subscriber packed_subscriber_;
};

}  // namespace view_servo

namespace ros
{
namespace message_traits
{
/** message_filters brings images and camera_info together by the stamps of their headers. */
template <>
struct HasHeader<view_servo::CameraImage> : public TrueType
{
};
}  // namespace message_traits
}  // namespace ros
