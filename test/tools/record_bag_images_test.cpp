// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "record_bag_test.h"

#include "sim_ros/robot_messages.h"
#include "view_servo/ros/conversions.h"

#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** A folder of images with poses, as others recorded it. */
class RecordBagImagesTest : public RecordBagTest
{
protected:
  RecordBagImagesTest()
  {
    std::filesystem::create_directories(path("walk/images"));
    cv::Mat picture(60, 80, CV_8UC3);
    for (const std::string name : { "7.png", "8.png", "9.png" })
    {
      cv::randu(picture, 0, 255);
      EXPECT_TRUE(cv::imwrite(path("walk/images/" + name), picture));
    }
    writeText("walk/K.txt", "5e1 0 39\n0 51 29\n0 0 1\n");
    writePoses(
        "# a remark\n7.png 1 0 0 0.1  0 1 0 0.2  0 0 1 0.3  0 0 0 1\n"
        "9.png 0 0 1 1  -1 0 0 2  0 -1 0 3  0 0 0 1\n");
  }

  void writePoses(const std::string& text) const
  {
    writeText("walk/poses.txt", text);
  }

  std::vector<std::string> arguments() const
  {
    return { "--images", path("walk"), out_ };
  }
};

TEST_F(RecordBagImagesTest, AreWrittenWithTheirPoses)
{
  ASSERT_EQ(run(arguments()).status, 0);
  const std::map<std::string, int> expected{ { CAMERA_INFOS, 2 }, { IMAGES, 2 }, { TRUTHS, 2 } };
  EXPECT_EQ(topicsOf(out_), expected);
  const std::vector<Image> images = messagesOf<Image>(out_, IMAGES);
  EXPECT_EQ(toGrey(images[1], "image").size(), cv::Size(80, 60));
  EXPECT_EQ(images[1].header.stamp, ros::Time(1000.25));
  EXPECT_EQ(images[1].encoding, sensor_msgs::image_encodings::MONO8);
  const CameraInfo info = messagesOf<CameraInfo>(out_, CAMERA_INFOS)[1];
  EXPECT_EQ(info.header, images[1].header);
  EXPECT_EQ(info.K[0], 50.0);
  EXPECT_EQ(info.P[6], 29.0);
  EXPECT_EQ(info.width, 80U);
  const Eigen::Isometry3d pose = sim::toIsometry(messagesOf<Truth>(out_, TRUTHS)[1].pose);
  EXPECT_TRUE(pose.translation().isApprox(Eigen::Vector3d(1.0, 2.0, 3.0)));
  EXPECT_TRUE(pose.linear().col(2).isApprox(Eigen::Vector3d::UnitX()));
  const std::string bytes = readText(out_);
  ASSERT_EQ(run(arguments()).status, 0);
  EXPECT_EQ(readText(out_), bytes);
}

TEST_F(RecordBagImagesTest, RefusesBadFolders)
{
  expectBadInput({ "--images", path("none"), out_ }, path("none"));
  expectBadInput({ "--images", path("walk") }, "OUT.bag");
  expectBadInput({ "--images", path("walk"), "desk", "way", out_ }, "OUT.bag");
  expectBadInput({ "--images", path("walk"), out_, "--seed", "3" }, "--seed");
  for (const std::string line :
       { "7.png 1 2 3", "7.png 2 0 0 0  0 2 0 0  0 0 2 0  0 0 0 1", "7.png 1 0 0 nan  0 1 0 0  0 0 1 0  0 0 0 1",
         "7.png 1 0 0 0  0 1 0 0  0 0 -1 0  0 0 0 1" })
  {
    writePoses("# remark\n" + line + "\n");
    expectBadInput(arguments(), "poses.txt: line 2 ");
  }
  writePoses("# nothing\n");
  expectBadInput(arguments(), "poses.txt");
  writePoses("7.png 1 0 0 0.1  0 1 0 0.2  0 0 1 0.3  0 0 0 1\ngone.png 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n");
  expectBadInput(arguments(), "gone.png");
  ASSERT_TRUE(cv::imwrite(path("walk/images/gone.png"), cv::Mat(30, 40, CV_8U, cv::Scalar(0))));
  expectBadInput(arguments(), "gone.png");
  writeText("walk/K.txt", "1 2 3");
  expectBadInput(arguments(), "K.txt");
}

TEST_F(RecordBagImagesTest, AreThoseOfARealWalk)
{
  const char* data = std::getenv("VIEW_SERVO_DATA");
  if (data == nullptr)
  {
    GTEST_SKIP() << "VIEW_SERVO_DATA is not set";
  }
  ASSERT_EQ(run({ "--images", std::string(data) + "/hololens_indoor", out_ }).status, 0);
  EXPECT_EQ(topicsOf(out_).at(IMAGES), 94);
  EXPECT_EQ(topicsOf(out_).at(TRUTHS), 94);
  EXPECT_LT(std::filesystem::file_size(out_), 15'000'000U);
  // The folder's own relative pose of two images, first in its list of pairs: X_6 = T X_1.
  const std::vector<Truth> truths = messagesOf<Truth>(out_, TRUTHS);
  const Eigen::Isometry3d relative = sim::toIsometry(truths[5].pose).inverse() * sim::toIsometry(truths[0].pose);
  EXPECT_LT((relative.translation() - Eigen::Vector3d(0.13428, 0.10470, -0.29566)).norm(), 2e-4);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
