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
#include <opencv2/videoio.hpp>

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

/** A video of 80x60, ten frames at 25 Hz, each brighter than the one before. */
class RecordBagVideoTest : public RecordBagTest
{
protected:
  RecordBagVideoTest() : video_(path("hand.avi"))
  {
    cv::VideoWriter writer(video_, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0, cv::Size(80, 60));
    for (int i = 0; i < 10; ++i)
    {
      writer.write(cv::Mat(60, 80, CV_8UC3, cv::Scalar::all(20.0 * i)));
    }
    writer.release();
    EXPECT_TRUE(std::filesystem::exists(video_));
  }

  std::string writeCalibration(int width) const
  {
    return writeText("calibration.yaml",
                     "image_width: " + std::to_string(width) +
                         "\nimage_height: 60\ndistortion_model: plumb_bob\n"
                         "camera_matrix: {rows: 3, cols: 3, data: [70, 0, 40, 0, 71, 30, 0, 0, 1]}\n"
                         "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n");
  }

  std::string video_;
};

TEST_F(RecordBagVideoTest, HasAllFramesAtTheirTimes)
{
  ASSERT_EQ(run({ "--video", video_, out_ }).status, 0);
  const std::map<std::string, int> expected{ { CAMERA_INFOS, 10 }, { IMAGES, 10 } };
  EXPECT_EQ(topicsOf(out_), expected);
  const std::vector<Image> images = messagesOf<Image>(out_, IMAGES);
  const std::vector<CameraInfo> infos = messagesOf<CameraInfo>(out_, CAMERA_INFOS);
  for (std::size_t i = 0; i < images.size(); ++i)
  {
    EXPECT_NEAR((images[i].header.stamp - ros::Time(1000.0)).toSec(), 0.04 * static_cast<double>(i), 1e-6);
    EXPECT_EQ(infos[i].header, images[i].header);
    EXPECT_NEAR(cv::mean(toGrey(images[i], "image"))[0], 20.0 * static_cast<double>(i), 4.0);
  }
  EXPECT_EQ(infos[0].width, 80U);
  EXPECT_EQ(infos[0].K[0], 0.0) << "nobody has said its calibration";
}

TEST_F(RecordBagVideoTest, TakesRateAndCalibration)
{
  ASSERT_EQ(run({ "--video", video_, out_, "--rate", "5", "--calibration", writeCalibration(80) }).status, 0);
  const std::vector<Image> images = messagesOf<Image>(out_, IMAGES);
  ASSERT_EQ(images.size(), 2U);
  EXPECT_NEAR((images[1].header.stamp - images[0].header.stamp).toSec(), 0.2, 1e-6);
  const CameraInfo info = messagesOf<CameraInfo>(out_, CAMERA_INFOS)[1];
  EXPECT_EQ(info.K[4], 71.0);
  EXPECT_EQ(info.D[0], 0.1);
  ASSERT_EQ(run({ "--video", video_, out_, "--rate", "90" }).status, 0);
  EXPECT_EQ(messagesOf<Image>(out_, IMAGES).size(), 10U) << "there are no more";
}

TEST_F(RecordBagVideoTest, RefusesWhatIsNoVideo)
{
  expectBadInput({ "--video", path("none.mp4"), out_ }, path("none.mp4"));
  expectBadInput({ "--video", path("."), out_ }, "no regular file");
  expectBadInput({ "--video", writeText("words.mp4", "no video"), out_ }, "words.mp4");
  expectBadInput({ "--video", video_ }, "OUT.bag");
  expectBadInput({ "--video", video_, "--images", path("walk"), out_ }, "not both");
  expectBadInput({ "--video", video_, out_, "--groups", "a" }, "not for --video");
  expectBadInput({ "--video", video_, out_, "--calibration", path("none.yaml") }, "none.yaml");
  expectBadInput({ "--video", video_, out_, "--calibration", writeCalibration(81) }, "81 x 60");
  expectBadInput({ nomad_, "way", out_, "--calibration", writeCalibration(80) }, "--video");
}

}  // namespace
}  // namespace test
}  // namespace view_servo
