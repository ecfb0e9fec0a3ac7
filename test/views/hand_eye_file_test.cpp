// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/hand_eye_file.h"

#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>

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

}  // namespace view_servo
