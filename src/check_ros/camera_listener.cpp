// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check_ros/camera_listener.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace view_servo::check
{
namespace
{
constexpr int IMAGE_QUEUE_SIZE = 5;  // as nodes have it
constexpr std::size_t KEPT = 20;     // messages of each kind

/** The newest message with a stamp; null when there is none. */
template <typename Pointer>
Pointer withStamp(const std::deque<Pointer>& messages, const ros::Time& stamp)
{
  for (auto message = messages.rbegin(); message != messages.rend(); ++message)
  {
    if ((*message)->header.stamp == stamp)
    {
      return *message;
    }
  }
  return nullptr;
}

template <typename Pointer>
void keep(std::deque<Pointer>& messages, const Pointer& message)
{
  messages.push_back(message);
  if (messages.size() > KEPT)
  {
    messages.pop_front();
  }
}

}  // namespace

double steadySeconds()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

CameraListener::CameraListener(const ros::NodeHandle& nh, const Setup& setup)
  : topics_{ nh.resolveName(setup.camera + "/" + setup.image), nh.resolveName(setup.camera + "/camera_info") },
    input_("image", "'" + topics_.image + "'", INPUT_TIMEOUT),
    last_time_(-std::numeric_limits<double>::infinity())
{
  ros::NodeHandle topics_nh(nh);
  image_subscriber_.registerCallback([this](const CameraImageConstPtr& image) {
    guarded("an image on '" + image->topic + "'", [&] { onImage(image); });
  });
  image_subscriber_.subscribe(nh, ros::NodeHandle("~"), topics_.image, setup.image_transport, IMAGE_QUEUE_SIZE);
  topics_.image = image_subscriber_.getTopic();
  const boost::function<void(const sensor_msgs::CameraInfoConstPtr&)> on_info =
      [this](const sensor_msgs::CameraInfoConstPtr& info) {
        guarded("camera_info on '" + topics_.info + "'", [&] { onInfo(info); });
      };
  info_subscriber_ = topics_nh.subscribe<sensor_msgs::CameraInfo>(topics_.info, IMAGE_QUEUE_SIZE, on_info);
}

void CameraListener::onImage(const CameraImageConstPtr& image)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  const DriverInput::Stamp place = input_.checkStamp(image->header.stamp);
  stamp_fault_ = place == DriverInput::Stamp::UNUSABLE ? input_.problem() : "";
  last_time_ = steadySeconds();
  images_.add(last_time_, ageOf(image->header.stamp), place == DriverInput::Stamp::LATE);
  keep(last_images_, image);
  if (const sensor_msgs::CameraInfoConstPtr info = withStamp(last_infos_, image->header.stamp))
  {
    pair(image, info);
  }
}

void CameraListener::onInfo(const sensor_msgs::CameraInfoConstPtr& info)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  infos_.add(steadySeconds(), ageOf(info->header.stamp), false);
  keep(last_infos_, info);
  if (const CameraImageConstPtr image = withStamp(last_images_, info->header.stamp))
  {
    pair(image, info);
  }
}

void CameraListener::pair(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info)
{
  pairs_ += frame_ && frame_->image == image ? 0 : 1;
  if (image->fault.empty())
  {
    frame_ = CameraFrame{ image, info };
  }
}

CameraObservations CameraListener::observations(const RosGraph& graph, double duration) const
{
  CameraObservations camera;
  camera.images.topic = topics_.image;
  camera.infos.topic = topics_.info;
  camera.images.publisher = graph.publisher(image_subscriber_.getTopic());
  camera.infos.publisher = graph.publisher(topics_.info);
  const std::lock_guard<std::mutex> lock(mutex_);
  images_.fill(camera.images);
  infos_.fill(camera.infos);
  camera.pairs = pairs_;
  camera.images.stamp_fault = stamp_fault_;
  camera.pairing_fault = faultOf(CameraTraffic{ images_.count(), infos_.count(), pairs_, duration }, topics_);
  if (last_images_.empty())
  {
    return camera;
  }
  const CameraImage& image = *last_images_.back();
  camera.width = static_cast<int>(image.width);
  camera.height = static_cast<int>(image.height);
  camera.encoding = image.encoding;
  camera.frame = image.header.frame_id;
  camera.age_fault = faultOfAge(image.header.stamp, topics_.image, CameraInputParams().max_image_age);
  if (frame_)
  {
    camera.calibration_fault = faultOf(*frame_->image, *frame_->info, topics_);
    camera.model = frame_->info->distortion_model;
    const Camera calibration = toCamera(*frame_->info);
    camera.focal_length = calibration.k(0, 0);
    camera.has_distortion = calibration.fault().empty() && !calibration.isPinhole();
  }
  try
  {
    camera.picture = measurePicture(toGrey(image));
  }
  catch (const ImageError& error)
  {
    camera.image_fault = oneLine(error);
  }
  return camera;
}

std::optional<CameraFrame> CameraListener::frame() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return frame_;
}

cv::Mat CameraListener::picture() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  try
  {
    return last_images_.empty() ? cv::Mat() : toGrey(*last_images_.back());
  }
  catch (const ImageError&)
  {
    return {};  // observations() says why
  }
}

std::string CameraListener::frameId() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return last_images_.empty() ? "" : last_images_.back()->header.frame_id;
}

std::vector<ros::Time> CameraListener::stamps() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<ros::Time> stamps;
  for (const CameraImageConstPtr& image : last_images_)
  {
    stamps.push_back(image->header.stamp);
  }
  return stamps;
}

double CameraListener::silence() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return steadySeconds() - last_time_;
}

int CameraListener::count() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return images_.count();
}

std::string CameraListener::apart(const DriverInput& odometry) const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return stampsApart(odometry, input_);
}

}  // namespace view_servo::check
