// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/camera_file.h"

#include "support/cameras.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
const std::string CALIBRATION = R"(image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500.5, 0, 320, 0, 501, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.1, 0.01, 0, 0.001, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [490, 0, 321, 0, 0, 491, 241, 0, 0, 0, 1, 0]
)";

class CameraFileTest : public testing::Test
{
protected:
  std::string write(const std::string& text) const
  {
    return test::writeText(directory_.path() / "camera.yaml", text);
  }

  static std::string complaintAbout(const std::string& path)
  {
    return test::thrownMessage<std::runtime_error>([&] { readCameraFile(path); });
  }

  test::TemporaryDirectory directory_;
};

}  // namespace

TEST_F(CameraFileTest, OfCameraCalibrationIsRead)
{
  const Camera camera = readCameraFile(write(CALIBRATION));
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.distortion_model, "plumb_bob");
  EXPECT_EQ(camera.distortion, (std::vector<double>{ -0.1, 0.01, 0.0, 0.001, 0.0 }));
  EXPECT_EQ(camera.k(0, 0), 500.5);
  EXPECT_EQ(camera.projection(1, 2), 241.0);
}

TEST_F(CameraFileTest, OfAPrintedMessageIsRead)
{
  const Camera camera = readCameraFile(
      write("width: 320\nheight: 240\ndistortion_model: \"\"\nD: []\nK: [300, 0, 160, 0, 300, 120, 0, 0, 1]\n"
            "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nP: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n"));
  EXPECT_EQ(camera.k(1, 2), 120.0);
  EXPECT_TRUE(camera.isPinhole());
}

TEST_F(CameraFileTest, OfAStoredViewIsRead)
{
  StoredView view;
  view.name = "dock";
  view.image = cv::Mat(240, 320, CV_8UC1, cv::Scalar(90));
  view.frame_id = "camera";
  Camera camera = test::pinholeCamera({ 320, 240 }, 300.0, 300.0, 160.0, 120.0);
  camera.distortion_model = "plumb_bob";
  camera.distortion = { 0.1, 0.0, 0.0, 0.0, 0.0 };
  view.camera = camera;
  ViewStore(directory_.path().string()).save(view, false);
  const Camera read = readCameraFile((directory_.path() / "dock.yaml").string());
  EXPECT_EQ(read.k, camera.k);
  EXPECT_EQ(read.distortion, camera.distortion);
}

TEST_F(CameraFileTest, ThatCannotBeUsedIsNamedWithWhatIsWrong)
{
  const std::string missing = (directory_.path() / "missing.yaml").string();
  EXPECT_NE(complaintAbout(missing).find("missing.yaml': there is no such file"), std::string::npos)
      << complaintAbout(missing);
  EXPECT_NE(complaintAbout(write("hello")).find("none of camera_matrix"), std::string::npos);
  std::string text = test::edited(CALIBRATION, "500.5", "-5.00");
  EXPECT_NE(complaintAbout(write(text)).find("K"), std::string::npos) << complaintAbout(write(text));
  text = test::edited(CALIBRATION, "500.5, 0,", "500.5,");
  EXPECT_NE(complaintAbout(write(text)).find("a list of 9 numbers has 8"), std::string::npos);
}

}  // namespace view_servo
