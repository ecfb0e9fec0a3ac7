// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/hand_eye_file.h"

#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
class HandEyeFileTest : public ::testing::Test
{
protected:
  /** What is wrong with a file of this text. */
  std::string faultOf(const std::string& text) const
  {
    test::writeText(path_, text);
    std::string fault = test::thrownMessage<std::runtime_error>([this] { readHandEyeFile(path_); });
    EXPECT_TRUE(fault.empty() || fault.find(path_) != std::string::npos) << fault;
    return fault;
  }

  test::TemporaryDirectory directory_;
  std::string path_ = (directory_.path() / "hand_eye.yaml").string();
};

// As easy_handeye writes it, with what this package has no use for.
const std::string PARAMETERS =
    "parameters:\n  eye_on_hand: true\n  freehand_robot_movement: false\n"
    "  move_group: manipulator\n  namespace: /calibration_eye_on_hand/\n"
    "  robot_base_frame: base_link\n  robot_effector_frame: tool0\n"
    "  tracking_base_frame: camera_optical_frame\n  tracking_marker_frame: marker\n";
const std::string TRANSFORMATION = "transformation: {qw: 0.5, qx: 0.5, qy: -0.5, qz: 0.5, x: 0.1, y: -0.2, z: 0.3}\n";

}  // namespace

TEST_F(HandEyeFileTest, ReadsWhatItHasWritten)
{
  HandEyeFile written;
  written.base_frame = "arm/base";
  written.flange_frame = "tool: 0";
  written.camera_frame = "camera";
  written.camera_in_flange =
      Eigen::Translation3d(0.01, -2.5, 3e-5) * Eigen::AngleAxisd(3.0, Eigen::Vector3d(1.0, -2.0, 0.5).normalized());
  written.covariance.assign(36, 1.5e-7);
  written.comment = "a comment";
  writeHandEyeFile(written, path_);
  const HandEyeFile read = readHandEyeFile(path_);
  EXPECT_EQ(read.base_frame, written.base_frame);
  EXPECT_EQ(read.flange_frame, written.flange_frame);
  EXPECT_EQ(read.camera_frame, written.camera_frame);
  EXPECT_TRUE(read.camera_in_flange.isApprox(written.camera_in_flange, 1e-9));
  EXPECT_EQ(read.covariance, written.covariance);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}), 1);
}

TEST_F(HandEyeFileTest, ReadsFilesOfEasyHandeye)
{
  test::writeText(path_, PARAMETERS + TRANSFORMATION);
  const HandEyeFile read = readHandEyeFile(path_);
  EXPECT_EQ(read.flange_frame, "tool0");
  EXPECT_EQ(read.camera_frame, "camera_optical_frame");
  EXPECT_TRUE(read.camera_in_flange.translation().isApprox(Eigen::Vector3d(0.1, -0.2, 0.3)));
  EXPECT_TRUE(read.camera_in_flange.linear().isApprox(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5).toRotationMatrix()));
  EXPECT_TRUE(read.covariance.empty());
}

TEST_F(HandEyeFileTest, NamesWhatIsWrong)
{
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has(faultOf(""), "parameters and transformation"));
  EXPECT_TRUE(has(faultOf("[1, 2]"), "parameters and transformation"));
  EXPECT_TRUE(has(faultOf(PARAMETERS), "parameters and transformation"));
  EXPECT_TRUE(has(faultOf(PARAMETERS + "transformation: {x: 0, y: 0}"), "transformation/z"));
  EXPECT_TRUE(
      has(faultOf(PARAMETERS + "transformation: {x: .nan, y: 0, z: 0, qx: 0, qy: 0, qz: 0, qw: 1}"), "not finite"));
  EXPECT_TRUE(has(faultOf(PARAMETERS + "transformation: {x: 0, y: 0, z: 0, qx: 0, qy: 0, qz: 0, qw: 0}"), "norm"));
  EXPECT_TRUE(has(faultOf(PARAMETERS + TRANSFORMATION + "covariance: [1, 2]"), "36"));
  EXPECT_TRUE(has(faultOf(test::edited(PARAMETERS, "true", "false") + TRANSFORMATION), "eye_on_hand"));
  EXPECT_TRUE(has(faultOf(test::edited(PARAMETERS, "tool0", "''") + TRANSFORMATION), "robot_effector_frame is empty"));
  EXPECT_TRUE(has(faultOf("parameters: ["), "no hand-eye calibration"));
  // yaml-cpp puts the character that it does not know into its text, here a form feed or carriage return.
  for (const std::string character : { "\f", "\v", "\r" })
  {
    const std::string fault = faultOf("parameters: \"\\" + character + "\"");
    EXPECT_TRUE(has(fault, "no hand-eye calibration")) << fault;
    EXPECT_EQ(fault.find_first_of("\n\r\f\v"), std::string::npos) << fault;
  }
  std::filesystem::remove(path_);
  EXPECT_THROW(readHandEyeFile(path_), std::runtime_error);
  EXPECT_THROW(writeHandEyeFile({}, (directory_.path() / "nowhere" / "x.yaml").string()), std::runtime_error);
}

class HandEyePosesFileTest : public HandEyeFileTest
{
protected:
  static HandEyePosesFile poses()
  {
    HandEyePosesFile file;
    file.base_frame = "base_link";
    file.flange_frame = "tool0";
    file.camera_frame = "camera_optical_frame";
    file.view_name = "shelf";
    file.view.k << 700.0, 0.0, 319.5, 0.0, 701.0, 239.5, 0.0, 0.0, 1.0;
    file.view.corners = { { 1.0, 2.0 }, { 101.5, 2.0 }, { 101.5, 52.25 }, { 1.0, 52.25 } };
    for (const double angle : { 0.1, -2.0 })
    {
      const Eigen::Isometry3d flange =
          Eigen::Translation3d(angle, 1.0 / 3.0, 0.0) * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY());
      Eigen::Matrix3d h;
      h << angle, -0.1 / 3.0, 20.0 * angle, 0.01, 0.9, -30.0, 1e-5 / 3.0, 2e-5, 1.0;
      file.poses.push_back({ flange, h });
    }
    file.comment = "a comment";
    return file;
  }

  /** What is wrong with a file in which one text takes the place of another. */
  std::string faultOfPoses(const std::string& before, const std::string& after) const
  {
    writeHandEyePosesFile(poses(), path_);
    test::writeText(path_, test::edited(test::readText(path_), before, after));
    return test::thrownMessage<std::runtime_error>([this] { readHandEyePosesFile(path_); });
  }
};

TEST_F(HandEyePosesFileTest, ReadsWhatItHasWritten)
{
  const HandEyePosesFile written = poses();
  writeHandEyePosesFile(written, path_);
  const HandEyePosesFile read = readHandEyePosesFile(path_);
  EXPECT_EQ(read.base_frame, written.base_frame);
  EXPECT_EQ(read.flange_frame, written.flange_frame);
  EXPECT_EQ(read.camera_frame, written.camera_frame);
  EXPECT_EQ(read.view_name, written.view_name);
  EXPECT_EQ(read.view.k, written.view.k);
  ASSERT_EQ(read.view.corners.size(), 4U);
  EXPECT_EQ(read.view.corners[2], written.view.corners[2]);
  ASSERT_EQ(read.poses.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i)
  {
    EXPECT_TRUE(read.poses[i].flange_in_base.isApprox(written.poses[i].flange_in_base, 1e-14));
    EXPECT_TRUE(read.poses[i].h.isApprox(written.poses[i].h, 1e-15));
  }
}

TEST_F(HandEyePosesFileTest, KeepsTheHeightOfTheCameraOfABase)
{
  HandEyePosesFile written = poses();
  writeHandEyePosesFile(written, path_);
  EXPECT_TRUE(std::isnan(readHandEyePosesFile(path_).camera_height));
  written.camera_height = 0.4125;
  writeHandEyePosesFile(written, path_);
  EXPECT_EQ(readHandEyePosesFile(path_).camera_height, 0.4125);
}

TEST_F(HandEyePosesFileTest, NamesWhatIsWrong)
{
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has(faultOfPoses("eye_on_hand: true", "eye_on_hand: false"), "eye_on_hand"));
  EXPECT_TRUE(has(faultOfPoses("view:", "picture:"), "parameters, view and poses"));
  EXPECT_TRUE(has(faultOfPoses("camera_matrix: [700,", "camera_matrix: ["), "view/camera_matrix has not 9 numbers"));
  EXPECT_TRUE(has(faultOfPoses("corners: [[1, 2]", "corners: [[1]"), "has not 2 numbers"));
  EXPECT_TRUE(has(faultOfPoses("homography: [0.1,", "homography: ["), "poses/0/homography has not 9 numbers"));
  EXPECT_TRUE(has(faultOfPoses("x: 0.1,", "x: .inf,"), "poses/0/flange is none"));
  EXPECT_TRUE(has(faultOfPoses("x: 0.1,", ""), "poses/0/flange/x"));
  EXPECT_TRUE(has(faultOfPoses("name: shelf", "names: shelf"), "view/name"));
  // 30,000 corners of 10,000 numbers in 150 kB, and a list that holds itself.
  std::string bomb = "corners: [&a [0";
  for (int i = 0; i < 10000; ++i)
  {
    bomb += ",1";
  }
  bomb += "]";
  for (int i = 0; i < 30000; ++i)
  {
    bomb += ",*a";
  }
  EXPECT_TRUE(has(faultOfPoses("corners: [[1, 2]", bomb), "more than a million values"));
  EXPECT_TRUE(has(faultOfPoses("corners: [[1, 2]", "corners: &a [*a, [1, 2]"), "nested deeper than 100"));
  std::filesystem::remove(path_);
  EXPECT_TRUE(has(test::thrownMessage<std::runtime_error>([this] { readHandEyePosesFile(path_); }), path_));
  EXPECT_THROW(writeHandEyePosesFile({}, (directory_.path() / "nowhere" / "x.yaml").string()), std::runtime_error);
}

}  // namespace view_servo
