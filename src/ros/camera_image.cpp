// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_image.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/join.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <image_transport/image_transport.h>
#include <image_transport/transport_hints.h>
#include <sensor_msgs/image_encodings.h>
#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
const std::string COMPRESSED = "compressed";

/** Names of the transports whose plugins can be loaded, e.g. "raw". */
std::vector<std::string> installedTransports(const image_transport::ImageTransport& images)
{
  std::vector<std::string> names;
  for (const std::string& name : images.getLoadableTransports())  // "image_transport/raw"
  {
    names.push_back(name.substr(name.rfind('/') + 1));
  }
  return names;
}

bool contains(const std::vector<std::string>& names, const std::string& name)
{
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

CameraImage::CameraImage(const sensor_msgs::ImageConstPtr& image, const std::string& from)
  : header(image->header),
    width(image->width),
    height(image->height),
    encoding(image->encoding),
    topic(from),
    raw(image)
{
}

CameraImage::CameraImage(const sensor_msgs::CompressedImageConstPtr& image, const std::string& from)
  : header(image->header), encoding(image->format), topic(from), packed(image)
{
  try
  {
    const cv::Size size = sizeOf(*image, topic);
    width = static_cast<std::uint32_t>(size.width);
    height = static_cast<std::uint32_t>(size.height);
  }
  catch (const ImageError& error)
  {
    fault = oneLine(error);
  }
}

cv::Mat toGrey(const CameraImage& image)
{
  return image.packed ? toGrey(*image.packed, image.topic) : toGrey(*image.raw, image.topic);
}

cv::Mat toColour(const CameraImage& image)
{
  if (!image.packed)
  {
    return toColour(*image.raw, image.topic);
  }
  cv::Mat decoded = decodeImage(std::string(image.packed->data.begin(), image.packed->data.end()), image.topic);
  if (decoded.type() != CV_8UC3)
  {
    cv::cvtColor(toGrey(decoded, image.topic), decoded, cv::COLOR_GRAY2BGR);
  }
  else if (decodedEncoding(image.packed->format, decoded.type()) == sensor_msgs::image_encodings::RGB8)
  {
    cv::cvtColor(decoded, decoded, cv::COLOR_RGB2BGR);
  }
  return decoded;
}

void CameraImageSubscriber::subscribe(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                      const std::string& topic, const std::string& transport, int queue_size)
{
  image_transport::ImageTransport images(nh);
  const image_transport::TransportHints hints(transport, ros::TransportHints(), private_nh);
  const std::string& wanted = hints.getTransport();
  std::vector<std::string> names = installedTransports(images);
  const auto length = static_cast<std::uint32_t>(queue_size);
  if (contains(names, wanted))
  {
    // Its topic is known once it has subscribed; images may come before.
    const std::string raw_topic = nh.resolveName(topic);
    topic_ = wanted == "raw" ? raw_topic : raw_topic + "/" + wanted;
    image_subscriber_ = images.subscribe(
        topic, length,
        [this](const sensor_msgs::ImageConstPtr& image) {
          guarded("an image on '" + topic_ + "'",
                  [&] { signalMessage(boost::make_shared<const CameraImage>(image, topic_)); });
        },
        ros::VoidPtr(), hints);
    return;
  }
  if (wanted != COMPRESSED)
  {
    if (!contains(names, COMPRESSED))
    {
      names.push_back(COMPRESSED);
    }
    std::sort(names.begin(), names.end());
    throw std::invalid_argument("image_transport: '" + wanted + "' is not installed; there are: " + join(names, ", "));
  }
  topic_ = nh.resolveName(topic) + "/" + COMPRESSED;
  const boost::function<void(const sensor_msgs::CompressedImageConstPtr&)> on_image =
      [this](const sensor_msgs::CompressedImageConstPtr& image) {
        guarded("an image on '" + topic_ + "'",
                [&] { signalMessage(boost::make_shared<const CameraImage>(image, topic_)); });
      };
  ros::NodeHandle topics_nh(nh);
  packed_subscriber_ = topics_nh.subscribe<sensor_msgs::CompressedImage>(topic_, length, on_image);
}

void CameraImageSubscriber::shutdown()
{
  image_subscriber_.shutdown();
  packed_subscriber_.shutdown();
}

}  // namespace view_servo
