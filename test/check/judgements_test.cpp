// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// A set-up in which all is well, and one change at a time: the finding that has to say so, and no other changes.
#include "check/judgements.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace view_servo::check
{
namespace
{
/** All that is observed at a base or an arm. */
struct Everything
{
  bool is_arm = false;
  CameraObservations camera;
  MountObservations mount;
  OdometryObservations odometry;
  CommandObservations commands;
  JointObservations joints;
  MachineObservations machine;
};

StreamObservations stream(const std::string& topic, double rate)
{
  StreamObservations result;
  result.topic = topic;
  result.publisher = "/driver";
  result.count = 100;
  result.rate = rate;
  result.usual_gap = 1.2 / rate;
  result.age = 0.01;
  return result;
}

/** Axes of the camera's frame in the base's, as columns. */
Eigen::Matrix3d axes(const Eigen::Vector3d& x, const Eigen::Vector3d& z)
{
  Eigen::Matrix3d matrix;
  matrix << x, z.cross(x), z;
  return matrix;
}

Everything wellBase()
{
  Everything all;
  all.camera.images = stream("/camera/image_raw", 10.0);
  all.camera.infos = stream("/camera/camera_info", 10.0);
  all.camera.pairs = 100;
  all.camera.width = 640;
  all.camera.height = 480;
  all.camera.encoding = "mono8";
  all.camera.frame = "camera_optical_frame";
  all.camera.model = "plumb_bob";
  all.camera.focal_length = 520.0;
  all.camera.picture = PictureMeasures{ "", 120.0, 0.01, 0.9, 500, 300 };
  all.mount.base_frame = "base_link";
  all.mount.camera_frame = "camera_optical_frame";
  all.mount.is_static = true;
  all.mount.base_from_camera.linear() = axes(-Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitX());
  all.mount.base_from_camera.translation() = Eigen::Vector3d(0.1, 0.0, 1.0);
  all.odometry.stream = stream("/odom", 50.0);
  all.odometry.frame = "odom";
  all.odometry.child_frame = "base_link";
  all.odometry.moved = 0.001;
  all.odometry.turned = 0.001;
  all.odometry.position_noise = 0.0005;
  all.odometry.yaw_noise = 0.0005;
  all.commands.topic = "/cmd_vel";
  all.commands.wanted_type = all.commands.type = "geometry_msgs/Twist";
  all.commands.listeners = { "/base_driver" };
  all.joints.stream = stream("/joint_states", 50.0);
  all.joints.described = true;
  all.machine.views_dir = "/home/robot/views";
  all.machine.disk_free = 5e9;
  all.machine.cores = 4;
  all.machine.cores_idle = 3.2;
  return all;
}

Everything wellArm()
{
  Everything all = wellBase();
  all.is_arm = true;
  all.mount.is_static = false;
  all.mount.age = 0.01;
  all.mount.base_from_camera.linear() = axes(Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitZ());  // it looks down
  all.mount.mount_fault = "the camera's optical axis is more than 60 degrees out of the horizontal";
  all.commands.wanted_type = all.commands.type = "geometry_msgs/TwistStamped";
  return all;
}

Findings judgeAll(const Everything& all)
{
  Findings findings = judgeCamera(all.camera);
  append(findings, judgeMount(all.mount, all.is_arm));
  append(findings, all.is_arm ? judgeJoints(all.joints) : judgeOdometry(all.odometry, all.camera.images.age));
  append(findings, judgeCommands(all.commands));
  append(findings, judgeMachine(all.machine));
  return findings;
}

struct Case
{
  std::string what;
  std::function<void(Everything&)> change;
  std::string name;  ///< of the finding
  Level level;
  std::string words;  ///< in its message
};

void expectOnly(const Case& expected, Everything all)
{
  SCOPED_TRACE(expected.what);
  expected.change(all);
  const Findings findings = judgeAll(all);
  const Finding* found = find(findings, expected.name);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->level, expected.level) << found->message;
  EXPECT_NE(found->message.find(expected.words), std::string::npos) << found->message;
  EXPECT_EQ(found->remedy.empty(), expected.level == Level::OK);
  for (const Finding& finding : findings)
  {
    EXPECT_TRUE(finding.name == expected.name || finding.level == Level::OK) << finding.name << ": " << finding.message;
    EXPECT_FALSE(finding.message.empty()) << finding.name;
    EXPECT_EQ(finding.message.find("nan"), std::string::npos) << finding.name << ": " << finding.message;
  }
}

TEST(CheckJudgements, FindNothingWhereAllIsWell)
{
  for (const Everything& all : { wellBase(), wellArm() })
  {
    const Findings findings = judgeAll(all);
    EXPECT_GE(findings.size(), 12U);
    for (const Finding& finding : findings)
    {
      EXPECT_EQ(finding.level, Level::OK) << finding.name << ": " << finding.message;
      EXPECT_TRUE(finding.remedy.empty()) << finding.name;
    }
    EXPECT_EQ(exitStatus(findings), 0);
  }
}

TEST(CheckJudgements, NameEachFaultOfTheCamera)
{
  const std::vector<Case> cases = {
    { "slow", [](Everything& a) { a.camera.images.rate = 2.0; }, "images", Level::WARNING, "2.0 Hz" },
    { "pauses", [](Everything& a) { a.camera.images.usual_gap = 0.4; }, "images", Level::WARNING, "400 ms" },
    { "small", [](Everything& a) { a.camera.height = 120; }, "images", Level::WARNING, "640 x 120" },
    { "encoding", [](Everything& a) { a.camera.image_fault = "image: encoding '32FC1'"; }, "images", Level::ERROR,
      "32FC1" },
    { "black", [](Everything& a) { a.camera.picture->lack_of_light = "nearly black"; }, "picture", Level::ERROR,
      "nearly black" },
    { "white", [](Everything& a) { a.camera.picture->overexposed = 0.4; }, "picture", Level::WARNING, "40 %" },
    { "bare wall", [](Everything& a) { a.camera.picture->corners = 12; }, "picture", Level::WARNING, "12 corners" },
    { "blurred", [](Everything& a) { a.camera.picture->edge_width = 3.4; }, "sharpness", Level::WARNING, "3.4 px" },
    { "no edges", [](Everything& a) { a.camera.picture->edge_width = UNKNOWN; }, "sharpness", Level::WARNING, "few" },
    { "no camera_info",
      [](Everything& a) {
        a.camera.infos.count = a.camera.pairs = 0;
        a.camera.pairing_fault = "no camera_info comes on '/camera/camera_info'";
      },
      "camera_info", Level::ERROR, "no camera_info comes" },
    { "half of the images", [](Everything& a) { a.camera.pairs = 50; }, "camera_info", Level::WARNING, "50 of 100" },
    { "never paired", [](Everything& a) { a.camera.focal_length = UNKNOWN; }, "calibration", Level::WARNING,
      "not known" },
    { "uncalibrated", [](Everything& a) { a.camera.calibration_fault = "the camera is not calibrated"; }, "calibration",
      Level::ERROR, "not calibrated" },
    { "rectified",
      [](Everything& a) {
        a.camera.images.topic = "/camera/image_rect_color/compressed";
        a.camera.has_distortion = true;
      },
      "calibration", Level::ERROR, "seems to be rectified" },
    { "not rectified, by its name",
      [](Everything& a) {
        a.camera.images.topic = "/camera_rect/image_direct";
        a.camera.has_distortion = true;
      },
      "calibration", Level::OK, "focal length" },
    { "telephoto", [](Everything& a) { a.camera.focal_length = 9000.0; }, "calibration", Level::WARNING, "4 degrees" },
    { "no stamps", [](Everything& a) { a.camera.images.stamp_fault = "image on 'x': no stamp, it is all zero"; },
      "image stamps", Level::ERROR, "all zero" },
    { "from the future", [](Everything& a) { a.camera.images.age = -0.15; }, "image stamps", Level::WARNING,
      "150 ms in the future" },
    { "old", [](Everything& a) { a.camera.age_fault = "the latest camera image on 'x' is 3 s old"; }, "image stamps",
      Level::ERROR, "3 s old" },
  };
  for (const Case& expected : cases)
  {
    expectOnly(expected, wellBase());
  }
  expectOnly({ "late", [](Everything& a) { a.camera.images.age = 0.3; }, "image stamps", Level::WARNING, "300 ms" },
             wellArm());
}

TEST(CheckJudgements, SayNothingOfImagesThatDoNotCome)
{
  Everything all = wellBase();
  all.camera = CameraObservations();
  all.camera.images.topic = "/camera/image_raw";
  Findings findings = judgeCamera(all.camera);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].level, Level::ERROR);
  EXPECT_EQ(findings[0].message, "no image has come on '/camera/image_raw': nobody publishes it");
  all.camera.images.publisher = "/camera";
  EXPECT_EQ(judgeCamera(all.camera)[0].message,
            "no image has come on '/camera/image_raw', though /camera publishes it");
}

TEST(CheckJudgements, NameEachFaultOfTheMount)
{
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const std::string steep = "the camera's optical axis is more than 60 degrees out of the horizontal";
  const auto turned = [](const Eigen::Vector3d& right, const Eigen::Vector3d& ahead, const std::string& fault = "") {
    return [=](Everything& a) {
      a.mount.base_from_camera.linear() = axes(right, ahead);
      a.mount.mount_fault = fault;
    };
  };
  const std::vector<Case> base = {
    { "unknown to tf", [](Everything& a) { a.mount.fault = "tf does not know the frame 'c'"; }, "tf", Level::ERROR,
      "does not know" },
    { "a dead publisher",
      [](Everything& a) {
        a.mount.is_static = false;
        a.mount.age = 7.0;
      },
      "tf", Level::WARNING, "7.0 s old" },
    { "no name", [](Everything& a) { a.mount.camera_frame = ""; }, "camera frame", Level::ERROR, "empty" },
    { "a body's frame", turned(x, z, steep), "camera mount", Level::ERROR, "not optical" },
    { "at the floor", turned(-y, -z, steep), "camera mount", Level::ERROR, "60 degrees" },
    { "upside down", turned(y, x), "camera mount", Level::WARNING, "upside down" },
    { "on its side", turned(-z, x), "camera mount", Level::WARNING, "rolled by -90 degrees" },
    { "backwards", turned(y, -x), "camera mount", Level::OK, "back" },
    { "to the left", turned(x, y), "camera mount", Level::OK, "90 degrees to the left" },
    { "slightly down", turned(-y, (x - 0.2 * z).normalized()), "camera mount", Level::OK, "11 degrees down" },
  };
  for (const Case& expected : base)
  {
    if (expected.name == "tf" && expected.level == Level::ERROR)
    {
      Everything all = wellBase();
      expected.change(all);
      EXPECT_EQ(find(judgeAll(all), "camera mount"), nullptr);
    }
    expectOnly(expected, wellBase());
  }
  const std::vector<Case> arm = {
    { "a body's name", [](Everything& a) { a.mount.camera_frame = "camera_link"; }, "camera frame", Level::WARNING,
      "camera_link" },
    { "tf too late for images", [](Everything& a) { a.mount.fault_at_images = "tf does not know: extrapolation"; },
      "tf", Level::ERROR, "extrapolation" },
    { "a dead publisher", [](Everything& a) { a.mount.age = 7.0; }, "tf", Level::ERROR, "7.0 s old" },
    { "no frame wanted", [](Everything& a) { a.mount.base_frame = ""; }, "camera frame", Level::OK, "camera_optical" },
  };
  for (const Case& expected : arm)
  {
    expectOnly(expected, wellArm());
  }
}

TEST(CheckJudgements, NameEachFaultOfOdometry)
{
  const std::vector<Case> cases = {
    { "slow", [](Everything& a) { a.odometry.stream.rate = 5.0; }, "odometry", Level::WARNING, "5.0 Hz" },
    { "pauses", [](Everything& a) { a.odometry.stream.usual_gap = 0.3; }, "odometry", Level::WARNING, "300 ms" },
    { "two sources", [](Everything& a) { a.odometry.fault = "2 nodes publish odometry"; }, "odometry frames",
      Level::ERROR, "2 nodes" },
    { "no stamps", [](Everything& a) { a.odometry.stream.stamp_fault = "odometry on 'x': no stamp"; },
      "odometry stamps", Level::ERROR, "no stamp" },
    { "in disorder", [](Everything& a) { a.odometry.stream.late_share = 0.2; }, "odometry stamps", Level::WARNING,
      "20 %" },
    { "clocks far apart", [](Everything& a) { a.odometry.apart_fault = "odometry is stamped 3 s after the images"; },
      "clocks", Level::ERROR, "3 s after" },
    { "clocks apart", [](Everything& a) { a.odometry.stream.age = 0.25; }, "clocks", Level::WARNING, "240 ms behind" },
    { "clocks from the future", [](Everything& a) { a.odometry.stream.age = -0.1; }, "clocks", Level::WARNING,
      "110 ms ahead" },
    { "noise", [](Everything& a) { a.odometry.position_noise = 0.01; }, "odometry at rest", Level::WARNING, "10.0 mm" },
    { "yaw noise", [](Everything& a) { a.odometry.yaw_noise = 0.01; }, "odometry at rest", Level::WARNING,
      "0.57 degrees" },
    { "it drives", [](Everything& a) { a.odometry.moved = 0.5; }, "odometry at rest", Level::OK, "not judged" },
  };
  for (const Case& expected : cases)
  {
    expectOnly(expected, wellBase());
  }
  OdometryObservations silent;
  silent.stream.topic = "/odom";
  const Findings findings = judgeOdometry(silent, 0.01);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].level, Level::ERROR);
  EXPECT_EQ(findings[0].message, "no odometry has come on '/odom': nobody publishes it");
}

TEST(CheckJudgements, NameEachFaultOfCommandsAndJoints)
{
  const std::vector<Case> base = {
    { "no listener", [](Everything& a) { a.commands.listeners.clear(); }, "commands", Level::ERROR, "nobody listens" },
    { "no listener in a dry run",
      [](Everything& a) {
        a.commands.listeners.clear();
        a.commands.dry_run = true;
      },
      "commands", Level::OK, "dry run" },
    { "another type", [](Everything& a) { a.commands.type = "geometry_msgs/TwistStamped"; }, "commands", Level::ERROR,
      "TwistStamped" },
    { "a listener to stamped commands",
      [](Everything& a) {
        a.commands.listeners.clear();
        a.commands.stamped_topic = "/cmd_vel_stamped";
        a.commands.stamped_listeners = { "/stamped_driver" };
      },
      "commands", Level::OK, "/stamped_driver" },
    { "a rival", [](Everything& a) { a.commands.publishers = { "/teleop" }; }, "commands", Level::WARNING, "/teleop" },
  };
  for (const Case& expected : base)
  {
    expectOnly(expected, wellBase());
  }
  const std::vector<Case> arm = {
    { "silent", [](Everything& a) { a.joints.stream.count = 0; }, "joint states", Level::WARNING, "no joint state" },
    { "no URDF", [](Everything& a) { a.joints.described = false; }, "joint states", Level::WARNING,
      "robot_description" },
    { "another arm's",
      [](Everything& a) {
        a.joints.unknown = { "a", "b", "c", "d", "e", "f" };
        a.joints.is_other = true;
      },
      "joint states", Level::ERROR, "a, b, c, d and 2 more" },
    { "a gripper's, too", [](Everything& a) { a.joints.unknown = { "finger" }; }, "joint states", Level::WARNING,
      "no joints finger" },
    { "on no flange", [](Everything& a) { a.mount.is_static = true; }, "tf", Level::ERROR,
      "does not move when the arm" },
    { "one is lacking", [](Everything& a) { a.joints.silent = { "wrist" }; }, "joint states", Level::WARNING, "wrist" },
    { "degrees", [](Everything& a) { a.joints.fault = "joint 'elbow' is at 90"; }, "joint states", Level::ERROR,
      "at 90" },
  };
  for (const Case& expected : arm)
  {
    expectOnly(expected, wellArm());
  }
}

TEST(CheckJudgements, NameEachFaultOfTheMachine)
{
  const std::vector<Case> cases = {
    { "a clock that stands",
      [](Everything& a) {
        a.machine.sim_time = a.machine.clock_published = true;
        a.machine.clock_rate = 0.0;
      },
      "time", Level::ERROR, "stands still" },
    { "simulated",
      [](Everything& a) {
        a.machine.sim_time = a.machine.clock_published = true;
        a.machine.clock_rate = 0.5;
      },
      "time", Level::OK, "0.50 times" },
    { "a clock that nobody uses", [](Everything& a) { a.machine.clock_published = true; }, "time", Level::WARNING,
      "use_sim_time" },
    { "little space", [](Everything& a) { a.machine.disk_free = 1e8; }, "views' disk", Level::WARNING, "100 MB" },
    { "no space", [](Everything& a) { a.machine.disk_free = 1e6; }, "views' disk", Level::ERROR, "1 MB" },
    { "no right", [](Everything& a) { a.machine.disk_fault = "views cannot be written to 'x'"; }, "views' disk",
      Level::ERROR, "cannot be written" },
    { "busy", [](Everything& a) { a.machine.cores_idle = 0.1; }, "processor", Level::WARNING, "0.1 of 4" },
    { "a silent system", [](Everything& a) { a.machine.cores_idle = UNKNOWN; }, "processor", Level::WARNING,
      "does not tell" },
  };
  for (const Case& expected : cases)
  {
    expectOnly(expected, wellBase());
  }
}

}  // namespace
}  // namespace view_servo::check
