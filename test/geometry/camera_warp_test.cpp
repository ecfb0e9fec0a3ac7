// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera_warp.h"

#include "support/cameras.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <cmath>
#include <stdexcept>

namespace view_servo
{
namespace
{
Camera pinhole()
{
  return test::pinholeCamera({ 640, 480 }, 500.0, 500.0, 320.0, 240.0);
}

Camera barrel(double k1)
{
  Camera camera = pinhole();
  camera.distortion_model = "plumb_bob";
  camera.distortion = { k1, 0.0, 0.0, 0.0, 0.0 };
  camera.projection << 450.0, 0.0, 322.0, 0.0, 0.0, 450.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  return camera;
}

Camera fisheye()
{
  Camera camera = pinhole();
  camera.k(0, 0) = camera.k(1, 1) = 330.0;
  camera.distortion_model = "equidistant";
  camera.distortion.assign(4, 0.0);
  return camera;
}

Camera large()
{
  Camera camera = test::pinholeCamera({ 860, 480 }, 670.0, 663.0, 423.0, 235.0);
  camera.distortion_model = "rational_polynomial";
  camera.distortion = { 0.2, -0.1, 0.0005, -0.0003, 0.01, 0.3, -0.08, 0.0 };
  return camera;
}

/** What a camera sees of a smooth pattern on the plane z = 1. */
cv::Mat picture(const Camera& camera)
{
  cv::Mat image(camera.height, camera.width, CV_8UC1);
  Points pixels;
  for (int v = 0; v < image.rows; ++v)
  {
    for (int u = 0; u < image.cols; ++u)
    {
      pixels.emplace_back(u, v);
    }
  }
  const Points points = camera.normalized(pixels);
  std::size_t i = 0;
  for (int v = 0; v < image.rows; ++v)
  {
    for (int u = 0; u < image.cols; ++u, ++i)
    {
      const double light = 128.0 + 60.0 * std::sin(25.0 * points[i].x()) + 60.0 * std::cos(31.0 * points[i].y());
      image.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(light);
    }
  }
  return image;
}

TEST(CameraWarp, LeavesImagesOfTheSameCameraAlone)
{
  for (const Camera& camera : { pinhole(), barrel(-0.2), fisheye() })
  {
    const CameraWarp warp(camera, camera);
    const cv::Mat image(480, 640, CV_8UC1, cv::Scalar(7));
    EXPECT_FALSE(warp.active());
    EXPECT_EQ(warp.image(image).data, image.data);
    EXPECT_EQ(warp.point({ 3.0, 4.0 }), Eigen::Vector2d(3.0, 4.0));
    EXPECT_EQ(warp.region({ 1, 2, 3, 4 }), cv::Rect(1, 2, 3, 4));
    EXPECT_TRUE(warp.region(cv::Rect()).empty());
    EXPECT_TRUE(warp.homography().isIdentity(1e-12));
  }
  EXPECT_FALSE(CameraWarp(pinhole(), pinhole().rectified()).active());
}

TEST(CameraWarp, RemovesDistortion)
{
  constexpr double K1 = -0.2;
  const CameraWarp warp(barrel(K1), barrel(K1).rectified());
  EXPECT_TRUE(warp.active());
  EXPECT_EQ(warp.to().k(0, 0), 450.0);
  EXPECT_EQ(warp.to().k(1, 2), 241.0);
  const Eigen::Vector2d ideal(0.3, -0.2);
  const Eigen::Vector2d distorted = (1.0 + K1 * ideal.squaredNorm()) * ideal;
  const Eigen::Vector2d raw(500.0 * distorted.x() + 320.0, 500.0 * distorted.y() + 240.0);
  const Eigen::Vector2d rectified(450.0 * ideal.x() + 322.0, 450.0 * ideal.y() + 241.0);
  EXPECT_LT((warp.point(raw) - rectified).norm(), 0.01);

  const cv::Point at(cvRound(raw.x()), cvRound(raw.y()));
  const cv::Rect region = warp.region({ at.x - 10, at.y - 10, 21, 21 });
  EXPECT_TRUE(region.contains(cv::Point(cvRound(rectified.x()), cvRound(rectified.y()))));
  EXPECT_NEAR(region.width, 21 * 450.0 / 500.0, 4.0);
}

TEST(CameraWarp, ShowsWhatTheOtherCameraSees)
{
  const Camera cameras[] = { pinhole(), barrel(-0.2), fisheye(), large() };
  for (const Camera& from : cameras)
  {
    const cv::Mat image = picture(from);
    for (const Camera& to : cameras)
    {
      const CameraWarp warp(from, to);
      const cv::Rect seen = warp.active() ? warp.region(cv::Rect()) : cv::Rect(0, 0, to.width, to.height);
      ASSERT_GT(seen.area(), 0.2 * to.width * to.height) << from.distortion_model << " to " << to.distortion_model;
      cv::Mat difference;
      cv::absdiff(warp.image(image)(seen), picture(to)(seen), difference);
      EXPECT_LT(cv::mean(difference)[0], 2.0) << from.distortion_model << " to " << to.distortion_model;
    }
  }
}

TEST(CameraWarp, TurnsIntoTheRectifiedFrame)
{
  Camera camera = barrel(-0.2);
  camera.rectification = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const CameraWarp warp(camera, camera.rectified());
  const Eigen::Vector3d ray(0.1, -0.05, 1.0);
  const Eigen::Vector3d expected = warp.to().k * camera.rectification * ray;
  EXPECT_LT((warp.point(camera.project(ray)) - expected.hnormalized()).norm(), 0.01);
  EXPECT_FALSE(CameraWarp(camera, camera).active());
}

TEST(CameraWarp, LeavesOutWhatTheOtherCameraDidNotSee)
{
  Camera narrow = pinhole();
  narrow.k(0, 0) = narrow.k(1, 1) = 1000.0;
  const CameraWarp warp(narrow, pinhole());
  const cv::Mat white(480, 640, CV_8UC1, cv::Scalar(255));
  const cv::Mat image = warp.image(white);
  EXPECT_EQ(image.at<unsigned char>(5, 5), 0);
  EXPECT_EQ(image.at<unsigned char>(240, 320), 255);
  const cv::Rect seen = warp.region(cv::Rect());
  EXPECT_NEAR(seen.width, 320, 3);
  EXPECT_NEAR(seen.height, 240, 3);
  EXPECT_EQ(cv::countNonZero(image(seen)), seen.area());
  // What the new camera does not show at all has no region.
  EXPECT_TRUE(CameraWarp(pinhole(), narrow).region({ 0, 0, 50, 50 }).empty());
}

TEST(CameraWarp, ShowsNothingTwiceWhereDistortionFoldsBack)
{
  Camera raw = pinhole();
  raw.k(0, 0) = raw.k(1, 1) = 600.0;
  raw.distortion_model = "plumb_bob";
  raw.distortion = { -0.4, 0.0, 0.0, 0.0 };
  Camera wide = pinhole();
  wide.k(0, 0) = wide.k(1, 1) = 240.0;
  const CameraWarp warp(raw, wide);
  const cv::Mat image = warp.image(cv::Mat(480, 640, CV_8UC1, cv::Scalar(255)));
  for (int v = 0; v < image.rows; ++v)
  {
    for (int u = 0; u < image.cols; ++u)
    {
      const Eigen::Vector2d ray = wide.normalized(Eigen::Vector2d(u, v));
      // r (1 - 0.4 r²) is largest at r = 0.913.
      if (ray.norm() > 0.95)
      {
        ASSERT_EQ(image.at<unsigned char>(v, u), 0) << u << ", " << v;
      }
    }
  }
  EXPECT_EQ(image.at<unsigned char>(240, 320), 255);
}

TEST(CameraWarp, RefusesWhatItCannotDo)
{
  Camera camera = pinhole();
  camera.k.setZero();
  EXPECT_THROW(CameraWarp(camera, pinhole()), std::invalid_argument);
  EXPECT_THROW(CameraWarp(pinhole(), camera), std::invalid_argument);
  EXPECT_THROW(CameraWarp(pinhole(), pinhole()).image(cv::Mat(10, 10, CV_8UC1)), std::invalid_argument);
}

}  // namespace
}  // namespace view_servo
