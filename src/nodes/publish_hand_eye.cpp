// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/views/hand_eye_file.h"

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <exception>
#include <memory>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
constexpr int BAD_INPUT = 2;
constexpr double LOOK_PERIOD = 0.5;  // [s]

/** The frame at the top of the tree that a frame is in; the frame itself where tf does not know it. */
std::string rootOf(const tf2_ros::Buffer& buffer, std::string frame)
{
  for (std::string parent; buffer._getParent(frame, ros::Time(0), parent);)
  {
    frame = parent;
  }
  return frame;
}

/**
 * The transform to publish. Each frame of tf has one parent at most: of a camera whose driver publishes frames of its
 * own, such as camera_link above the optical frame, the top one is placed.
 */
geometry_msgs::TransformStamped placed(const tf2_ros::Buffer& buffer, const HandEyeFile& file, bool inverse)
{
  const std::string parent = withoutSlash(inverse ? file.camera_frame : file.flange_frame);
  const std::string child = withoutSlash(inverse ? file.flange_frame : file.camera_frame);
  Eigen::Isometry3d child_in_parent = inverse ? file.camera_in_flange.inverse() : file.camera_in_flange;
  const std::string root = rootOf(buffer, child);
  if (root == rootOf(buffer, parent))
  {
    throw std::runtime_error("tf knows already where '" + file.camera_frame + "' is on '" + file.flange_frame +
                             "': stop what publishes that, then start again");
  }
  if (root != child)
  {
    if (inverse)
    {
      throw std::runtime_error("'" + file.flange_frame + "' has a parent in tf, '" + root +
                               "' at the top, and cannot get another one: leave ~inverse false");
    }
    child_in_parent = child_in_parent * toIsometry(buffer.lookupTransform(child, root, ros::Time(0)).transform);
  }
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = ros::Time::now();
  transform.header.frame_id = parent;
  transform.child_frame_id = root;
  transform.transform.translation = toMessage(Eigen::Vector3d(child_in_parent.translation()));
  transform.transform.rotation = toMessage(Eigen::Quaterniond(child_in_parent.linear()));
  return transform;
}

void run()
{
  std::string path;
  bool inverse = false;
  double patience = 2.0;
  ParameterReader reader(ros::NodeHandle("~"));
  reader.read({
      text("file", path, "hand-eye calibration, as calibrate_hand_eye or easy_handeye writes it"),
      boolean("inverse", inverse, "place the flange in the camera's frame, where tf has the camera above"),
      real("patience", patience, "s", "[0, 60]", "for how long tf is listened to before"),
  });
  reader.finish();
  const HandEyeFile file = readHandEyeFile(path);
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer);
  ros::WallDuration(patience).sleep();  // until tf has come of all who publish it
  geometry_msgs::TransformStamped transform;
  std::unique_ptr<tf2_ros::StaticTransformBroadcaster> broadcaster;
  const auto publish = [&] {
    transform = placed(buffer, file, inverse);
    broadcaster = std::make_unique<tf2_ros::StaticTransformBroadcaster>();  // without what the last one has published
    broadcaster->sendTransform(transform);
    ROS_INFO_STREAM("hand-eye calibration of '" << path << "': '" << transform.child_frame_id << "' is placed in '"
                                                << transform.header.frame_id << "'");
  };
  publish();
  // A driver that starts later may give the frame another parent: then what is above that has to be placed.
  const ros::SteadyTimer watch =
      ros::NodeHandle().createSteadyTimer(ros::WallDuration(LOOK_PERIOD), [&](const ros::SteadyTimerEvent& /*event*/) {
        std::string parent;
        if (buffer._getParent(transform.child_frame_id, ros::Time(0), parent) && parent != transform.header.frame_id)
        {
          publish();
        }
      });
  ros::spin();
}

}  // namespace
}  // namespace view_servo

/**
 * Publishes a hand-eye calibration as a static transform.
 *
 * Parameters: `~file` (string) as calibrate_hand_eye or easy_handeye writes it; `~inverse` (bool, false) the flange in
 * the camera's frame instead, where tf has the camera above; `~patience` (double, 2.0) for how long tf is listened to
 * before [s].
 *
 * Publishes: `/tf_static`, from the flange to the camera's frame, or to the frame at the top of the camera's own tree.
 */
int main(int argc, char** argv)
{
  ros::init(argc, argv, "publish_hand_eye");
  const ros::NodeHandle nh;  // what is logged at the end comes out as long as there is one
  try
  {
    view_servo::run();
    return 0;
  }
  catch (const std::exception& error)
  {
    ROS_FATAL_STREAM(view_servo::oneLine(error));
    return view_servo::BAD_INPUT;
  }
}
