// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/hand_eye_bag.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <cstddef>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
/** The topic of a robot without a namespace. */
std::string topicOf(const std::string& space, const std::string& name)
{
  return "/" + withoutSlash(space) + "/" + name;
}

/** All that the bag knows of frames. */
void fill(tf2::BufferCore& frames, const rosbag::Bag& bag)
{
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TypeQuery("tf2_msgs/TFMessage")))
  {
    const bool fixed = instance.getTopic() == "/tf_static";
    const tf2_msgs::TFMessage::ConstPtr message = instance.instantiate<tf2_msgs::TFMessage>();
    for (std::size_t i = 0; message && i < message->transforms.size(); ++i)
    {
      frames.setTransform(message->transforms[i], "bag", fixed);
    }
  }
}

Camera cameraIn(const rosbag::Bag& bag, const std::string& topic)
{
  rosbag::View messages(bag, rosbag::TopicQuery(topic));
  const sensor_msgs::CameraInfo::ConstPtr info =
      messages.size() > 0 ? messages.begin()->instantiate<sensor_msgs::CameraInfo>() : nullptr;
  if (!info)
  {
    throw std::runtime_error("no camera_info is in it on '" + topic + "': record that, too, or say --camera");
  }
  Camera camera = toCamera(*info);
  if (const std::string fault = camera.fault(); !fault.empty())
  {
    throw std::runtime_error("'" + topic + "': " + fault);
  }
  return camera;
}

HandEyePosesFile posesIn(const rosbag::Bag& bag, const HandEyeSources& sources)
{
  const StoredView stored = ViewStore(viewsDir(sources.views_dir)).load(sources.view);
  HandEyeCollector collector(handEyeViewOf(stored, cameraIn(bag, topicOf(sources.camera, "camera_info"))));
  tf2::BufferCore frames(ros::Duration(1e8));  // however long the bag is
  fill(frames, bag);

  HandEyePosesFile result;
  const std::string topic = topicOf(sources.tracker, "homography");
  int followed = 0;
  int located = 0;
  std::string lacks;  // of the frames
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TopicQuery(topic)))
  {
    const Homography::ConstPtr message = instance.instantiate<Homography>();
    if (!message || message->view != sources.view || message->valid == 0)
    {
      collector.clear();
      continue;
    }
    ++followed;
    try
    {
      const Eigen::Isometry3d flange_in_base =
          toIsometry(frames
                         .lookupTransform(withoutSlash(sources.base_frame), withoutSlash(sources.flange_frame),
                                          message->header.stamp)
                         .transform);
      ++located;
      result.camera_frame = withoutSlash(message->header.frame_id);
      collector.add(message->header.stamp.toSec(), homographyOf(*message), flange_in_base);
    }
    catch (const tf2::TransformException& error)
    {
      lacks = oneLine(error);
    }
  }
  if (followed == 0)
  {
    throw std::runtime_error("no homography of view '" + sources.view + "' is in it on '" + topic +
                             "': record that, too, or say --view or --tracker");
  }
  if (located == 0)
  {
    throw std::runtime_error("its tf does not know '" + sources.flange_frame + "' in '" + sources.base_frame + "' (" +
                             lacks + "): record /tf and /tf_static, too, or say " + sources.frameOptions());
  }
  result.base_frame = sources.base_frame;
  result.flange_frame = sources.flange_frame;
  result.view_name = sources.view;
  result.view = collector.view();
  result.poses = collector.poses();
  const std::string flange = withoutSlash(sources.flange_frame);
  if (sources.on_base && frames.canTransform(flange, result.camera_frame, ros::Time(0)))
  {
    result.camera_height = frames.lookupTransform(flange, result.camera_frame, ros::Time(0)).transform.translation.z;
  }
  return result;
}

}  // namespace

HandEyePosesFile readHandEyeBag(const std::string& path, const HandEyeSources& sources)
{
  try
  {
    if (!std::filesystem::is_regular_file(path))
    {
      throw std::runtime_error("there is no such file");
    }
    const rosbag::Bag bag(path, rosbag::bagmode::Read);
    return posesIn(bag, sources);
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("no poses can be read from bag '" + path + "': " + oneLine(error));
  }
}

}  // namespace view_servo
