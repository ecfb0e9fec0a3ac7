// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/numbers.h"

#include "support/program_run.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "test_paths.h"

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <tf2_msgs/TFMessage.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file Runs the program record_bag itself, as a shell does, and reads what it wrote. */

using nav_msgs::Odometry;
using sensor_msgs::CameraInfo;
using sensor_msgs::Image;
using sensor_msgs::JointState;
using tf2_msgs::TFMessage;
using Truth = geometry_msgs::PoseStamped;

inline const std::string IMAGES = "/camera/image_raw";
inline const std::string CAMERA_INFOS = "/camera/camera_info";
inline const std::string TRUTHS = "/ground_truth";
inline const std::string ODOMETRY = "/odom";
inline const std::string JOINT_STATES = "/joint_states";
inline const std::string TF = "/tf";
inline const std::string TF_STATIC = "/tf_static";

/** Ends of the camera's entry are left open for each test. */
inline const std::string NOMAD_WORLD = R"(
robot: {kind: nomad, camera_height: 0.8}
camera: {width: 160, height: 120, fx: 130, fy: 132, cx: 81, cy: 58, noise: 2CAMERA}
textures:
  wall: {kind: blotches, size: [256, 128], seed: 3}
  poster: {kind: poster, size: [128, 128], seed: 4, count: 3}
rectangles:
  - {name: wall, size: [8, 3], position: [3, 0, 1], facing: [-1, 0, 0], texture: wall}
  - {name: poster, group: extra, size: [1, 1], position: [2.9, 0, 1], facing: [-1, 0, 0], texture: poster}
boxes:
  - {name: the pillar, size: [0.3, 0.3, 2], position: [1.5, 1.2, 0], texture: wall}
goal: {x: 0, y: 0}
trajectories:
  way:
    - {time: 5, x: -0.5, y: 0.2}
    - {time: 6, x: -0.3, y: 0.1, yaw_deg: 10}
    - {time: 7, x: -0.1, y: 0.1, yaw_deg: -10}
  crash:
    - {time: 0, x: 0.5, y: 1.2}
    - {time: 4, x: 1.5, y: 1.2}
  inside:
    - {time: 0, x: 1.5, y: 1.2}
  long:
    - {time: 0, x: 0, y: 0}
    - {time: 3601, x: 0, y: 0}
)";

inline const std::string PUMA_WORLD = R"(
robot: {kind: puma, position: [0.2, 0.1, 0.05], yaw_deg: 30}
camera: {width: 160, height: 120, fx: 130}
textures:
  table: {kind: poster, size: [256, 256], seed: 5}
rectangles:
  - {name: table, size: [2, 2], position: [0.6, 0, 0], facing: [0, 0, 1], texture: table}
goal: {position: [0.7, 0.3, 0.8], look_at: [0.8, 0.35, 0]}
trajectories:
  way:
    - {time: 0, position: [0.75, 0.25, 0.75], look_at: [0.85, 0.35, 0]}
    - {time: 1, position: [0.7, 0.3, 0.8], look_at: [0.8, 0.35, 0], roll_deg: 8}
    - {time: 2, position: [0.7, 0.35, 0.8], look_at: [0.8, 0.35, 0]}
  far:
    - {time: 0, position: [3, 0, 1], look_at: [4, 0, 0]}
)";

template <typename Message>
std::vector<Message> messagesOf(const std::string& file, const std::string& topic)
{
  const rosbag::Bag bag(file);
  std::vector<Message> messages;
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TopicQuery(topic)))
  {
    const auto message = instance.instantiate<Message>();
    EXPECT_TRUE(message) << topic << " holds " << instance.getDataType();
    messages.push_back(*message);
  }
  return messages;
}

/** Messages a topic has; their stamps in the bag must increase. */
inline std::map<std::string, int> topicsOf(const std::string& file)
{
  const rosbag::Bag bag(file);
  std::map<std::string, int> counts;
  std::map<std::string, ros::Time> last;
  for (const rosbag::MessageInstance& instance : rosbag::View(bag))
  {
    const std::string topic = instance.getTopic();
    EXPECT_GT(instance.getTime(), last[topic]) << topic;
    last[topic] = instance.getTime();
    ++counts[topic];
  }
  return counts;
}

/** Worlds of two robots, in a directory for files, and the program that is to record a bag. */
class RecordBagTest : public ::testing::Test
{
protected:
  RecordBagTest()
  {
    nomad_ = writeNomadWorld("nomad.yaml", "");
    puma_ = writeText("puma.yaml", PUMA_WORLD);
    out_ = path("out.bag");
  }

  std::string path(const std::string& name) const
  {
    return directory_.path() / name;
  }

  std::string writeText(const std::string& name, const std::string& text) const
  {
    return test::writeText(path(name), text);
  }

  /** @param camera more keys of the camera's entry. */
  std::string writeNomadWorld(const std::string& name, const std::string& camera) const
  {
    return writeText(name, edited(NOMAD_WORLD, "CAMERA", camera));
  }

  /** @param before commands that the shell carries out first. */
  static ProgramRun run(const std::vector<std::string>& arguments, const std::string& before = ":")
  {
    return runProgram(RECORD_BAG_PATH, arguments, before + "; export ROS_PACKAGE_PATH='" PACKAGE_DIR "'");
  }

  /** Records what should go well. @return the bag's file. */
  std::string record(const std::string& world, const std::vector<std::string>& more = {},
                     const std::string& name = "out.bag") const
  {
    std::vector<std::string> arguments{ world, "way", path(name) };
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun outcome = run(arguments);
    EXPECT_EQ(outcome.status, 0);
    EXPECT_EQ(outcome.out + outcome.err, "");
    return path(name);
  }

  /** Status 2, one line that names `culprit`, and no file. */
  void expectBadInput(const std::vector<std::string>& arguments, const std::string& culprit,
                      const std::string& before = ":") const
  {
    test::expectBadInput(run(arguments, before), culprit);
    for (const auto& entry : std::filesystem::directory_iterator(directory_.path()))
    {
      EXPECT_EQ(entry.path().string().find(out_), std::string::npos) << entry.path() << " is left";
    }
  }

  std::string nomad_;
  std::string puma_;
  std::string out_;

private:
  TemporaryDirectory directory_;
};

}  // namespace test
}  // namespace view_servo
