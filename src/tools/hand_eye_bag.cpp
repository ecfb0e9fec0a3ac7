// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/hand_eye_bag.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2/exceptions.h>

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

Camera cameraIn(const HandEyeRecording& recording, const std::string& topic)
{
  if (!recording.info)
  {
    throw std::runtime_error("no camera_info is in it on '" + topic + "': record that, too, or say --camera");
  }
  Camera camera = toCamera(*recording.info);
  if (const std::string fault = camera.fault(); !fault.empty())
  {
    throw std::runtime_error("'" + topic + "': " + fault);
  }
  return camera;
}

/** Sets what is in the bag. */
void read(const rosbag::Bag& bag, const HandEyeSources& sources, HandEyeRecording& recording)
{
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TypeQuery("tf2_msgs/TFMessage")))
  {
    if (const tf2_msgs::TFMessage::ConstPtr message = instance.instantiate<tf2_msgs::TFMessage>())
    {
      recording.addTransforms(*message, instance.getTopic() == "/tf_static");
    }
  }
  rosbag::View infos(bag, rosbag::TopicQuery(topicOf(sources.camera, "camera_info")));
  if (infos.size() > 0)
  {
    recording.info = infos.begin()->instantiate<sensor_msgs::CameraInfo>();
  }
  for (const rosbag::MessageInstance& instance :
       rosbag::View(bag, rosbag::TopicQuery(topicOf(sources.tracker, "homography"))))
  {
    recording.homographies.emplace_back(instance.instantiate<Homography>());
  }
}

}  // namespace

void HandEyeRecording::addTransforms(const tf2_msgs::TFMessage& message, bool fixed)
{
  for (const geometry_msgs::TransformStamped& transform : message.transforms)
  {
    frames.setTransform(transform, "bag", fixed);
  }
}

HandEyePosesFile posesIn(const HandEyeRecording& recording, const HandEyeSources& sources)
{
  const StoredView stored = ViewStore(viewsDir(sources.views_dir)).load(sources.view);
  HandEyeCollector collector(handEyeViewOf(stored, cameraIn(recording, topicOf(sources.camera, "camera_info"))));
  const tf2::BufferCore& frames = recording.frames;

  HandEyePosesFile result;
  const std::string topic = topicOf(sources.tracker, "homography");
  int followed = 0;
  int located = 0;
  std::string lacks;  // of the frames
  for (const Homography::ConstPtr& message : recording.homographies)
  {
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
  if (result.camera_frame.empty())
  {
    throw std::runtime_error("what is on '" + topic +
                             "' has no frame_id: let the camera's driver name the camera's frame");
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

HandEyePosesFile readHandEyeBag(const std::string& path, const HandEyeSources& sources)
{
  try
  {
    if (!std::filesystem::is_regular_file(path))
    {
      throw std::runtime_error("there is no such file");
    }
    const rosbag::Bag bag(path, rosbag::bagmode::Read);
    HandEyeRecording recording;
    read(bag, sources, recording);
    return posesIn(recording, sources);
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("no poses can be read from bag '" + path + "': " + oneLine(error));
  }
}

}  // namespace view_servo
