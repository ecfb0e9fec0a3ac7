// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/rectifier.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <stdexcept>

namespace view_servo
{
namespace
{
sensor_msgs::CameraInfo cameraInfo(double k1)
{
  sensor_msgs::CameraInfo info;
  info.header.stamp = ros::Time(1.0);
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.D = { k1, 0.0, 0.0, 0.0, 0.0 };
  info.K = { 500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0 };
  info.R = { 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0 };
  info.P = { 450.0, 0.0, 322.0, 0.0, 0.0, 450.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0 };
  return info;
}

TEST(Rectifier, LeavesImagesWithoutDistortionAlone)
{
  const Rectifier rectifier(cameraInfo(0.0));
  const cv::Mat image(480, 640, CV_8UC1, cv::Scalar(7));
  EXPECT_FALSE(rectifier.active());
  EXPECT_EQ(rectifier.k()(0, 0), 500.0);
  EXPECT_EQ(rectifier.image(image).data, image.data);
  EXPECT_EQ(rectifier.point({ 3.0, 4.0 }), Eigen::Vector2d(3.0, 4.0));
  EXPECT_EQ(rectifier.region({ 1, 2, 3, 4 }), cv::Rect(1, 2, 3, 4));
  EXPECT_EQ(rectifier.size(), cv::Size(640, 480));
}

TEST(Rectifier, RemovesDistortion)
{
  constexpr double K1 = -0.2;
  const Rectifier rectifier(cameraInfo(K1));
  EXPECT_TRUE(rectifier.active());
  EXPECT_EQ(rectifier.k()(0, 0), 450.0);
  EXPECT_EQ(rectifier.k()(1, 2), 241.0);
  const Eigen::Vector2d ideal(0.3, -0.2);
  const Eigen::Vector2d distorted = (1.0 + K1 * ideal.squaredNorm()) * ideal;
  const Eigen::Vector2d raw(500.0 * distorted.x() + 320.0, 500.0 * distorted.y() + 240.0);
  const Eigen::Vector2d rectified(450.0 * ideal.x() + 322.0, 450.0 * ideal.y() + 241.0);
  EXPECT_LT((rectifier.point(raw) - rectified).norm(), 0.01);

  // A dot goes where its middle goes.
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(0));
  const cv::Point at(cvRound(raw.x()), cvRound(raw.y()));
  image(cv::Rect(at - cv::Point(2, 2), cv::Size(5, 5))).setTo(255);
  cv::Point brightest;
  cv::minMaxLoc(rectifier.image(image), nullptr, nullptr, nullptr, &brightest);
  EXPECT_LT((Eigen::Vector2d(brightest.x, brightest.y) - rectified).norm(), 5.0);

  const cv::Rect region = rectifier.region({ at.x - 10, at.y - 10, 21, 21 });
  EXPECT_TRUE(region.contains(cv::Point(cvRound(rectified.x()), cvRound(rectified.y()))));
  EXPECT_NEAR(region.width, 21 * 450.0 / 500.0, 4.0);
  EXPECT_TRUE(rectifier.region(cv::Rect()).empty());
}

TEST(Rectifier, KnowsItsCalibration)
{
  const Rectifier rectifier(cameraInfo(-0.2));
  sensor_msgs::CameraInfo info = cameraInfo(-0.2);
  info.header.stamp = ros::Time(2.0);
  EXPECT_TRUE(rectifier.hasCalibration(info));
  EXPECT_FALSE(rectifier.hasCalibration(cameraInfo(-0.1)));
}

TEST(Rectifier, RefusesWhatItCannotDo)
{
  sensor_msgs::CameraInfo info = cameraInfo(0.1);
  info.K.fill(0.0);
  EXPECT_THROW(Rectifier{ info }, std::runtime_error);
  info = cameraInfo(0.1);
  info.distortion_model = "bent";
  EXPECT_THROW(Rectifier{ info }, std::runtime_error);
}

}  // namespace
}  // namespace view_servo
