// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/conversions.h"

#include "support/random_picture.h"
#include "support/thrown_message.h"

#include "view_servo/images/image_io.h"
#include "view_servo/ros/base_conversions.h"

#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
namespace enc = sensor_msgs::image_encodings;

sensor_msgs::CameraInfo exampleInfo()
{
  sensor_msgs::CameraInfo info;
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.D = { -0.2, 0.05, 0.001, -0.002, 0.0 };
  info.K = { 500.0, 0.0, 322.0, 0.0, 510.0, 238.0, 0.0, 0.0, 1.0 };
  info.R = { 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0 };
  info.P = { 480.0, 0.0, 320.0, -12.0, 0.0, 490.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0 };
  return info;
}

/** A smooth picture with colour, so that demosaicing and grey conversion are well defined. */
cv::Mat examplePicture()
{
  cv::Mat picture(48, 64, CV_8UC3);
  for (int v = 0; v < picture.rows; ++v)
  {
    for (int u = 0; u < picture.cols; ++u)
    {
      picture.at<cv::Vec3b>(v, u) = cv::Vec3b(cv::saturate_cast<uchar>(2 * u), cv::saturate_cast<uchar>(3 * v),
                                              cv::saturate_cast<uchar>(40 + u + v));
    }
  }
  return picture;
}

std::string errorOf(const sensor_msgs::Image& image)
{
  return test::thrownMessage<ImageError>([&] { toGrey(image, "the image"); });
}

TEST(CameraConversion, KeepsEveryFieldThereAndBack)
{
  const sensor_msgs::CameraInfo info = exampleInfo();
  const Camera camera = toCamera(info);
  EXPECT_TRUE(camera.calibrated());
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_DOUBLE_EQ(camera.k(0, 2), 322.0);
  EXPECT_DOUBLE_EQ(camera.k(1, 1), 510.0);

  std_msgs::Header header;
  header.frame_id = "camera_optical_frame";
  const sensor_msgs::CameraInfo back = toCameraInfo(camera, header);
  EXPECT_EQ(back.header.frame_id, "camera_optical_frame");
  EXPECT_EQ(back.width, info.width);
  EXPECT_EQ(back.height, info.height);
  EXPECT_EQ(back.distortion_model, info.distortion_model);
  EXPECT_EQ(back.D, info.D);
  EXPECT_EQ(back.K, info.K);
  EXPECT_EQ(back.R, info.R);
  EXPECT_EQ(back.P, info.P);
}

TEST(CameraConversion, WorksBinningAndRegionIntoTheIntrinsics)
{
  sensor_msgs::CameraInfo info = exampleInfo();
  info.roi.x_offset = 100;
  info.roi.y_offset = 60;
  info.roi.width = 400;
  info.roi.height = 300;
  info.binning_x = 2;
  info.binning_y = 2;
  const Camera camera = toCamera(info);
  EXPECT_EQ(camera.width, 200);
  EXPECT_EQ(camera.height, 150);
  EXPECT_DOUBLE_EQ(camera.k(0, 0), 250.0);
  EXPECT_DOUBLE_EQ(camera.k(0, 2), (322.0 - 100.0) / 2.0);
  EXPECT_DOUBLE_EQ(camera.k(1, 2), (238.0 - 60.0) / 2.0);
}

TEST(CameraConversion, TellsAnUncalibratedCamera)
{
  sensor_msgs::CameraInfo info;
  info.width = 640;
  info.height = 480;
  EXPECT_EQ(toCamera(info).fault(), "the camera is not calibrated: K has no focal lengths");
  EXPECT_EQ(toCamera(exampleInfo()).fault(), "");
}

TEST(CameraConversion, TellsSizesThatNoCameraHas)
{
  sensor_msgs::CameraInfo info = exampleInfo();
  info.width = 4294967295U;
  EXPECT_EQ(toCamera(info).fault(), "images of 2147483647 x 480 pixels are too large: over 50 million");
  info = exampleInfo();
  info.roi.width = info.roi.height = 4294967295U;
  info.binning_x = info.binning_y = 2;
  EXPECT_EQ(toCamera(info).fault(), "images of 2147483647 x 2147483647 pixels are too large: over 50 million");
}

TEST(ImageConversion, TurnsEveryEncodingIntoTheSameGrey)
{
  const cv::Mat bgr = examplePicture();
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  const auto convert = [&](int code) {
    cv::Mat result;
    cv::cvtColor(bgr, result, code);
    return result;
  };
  const auto wide = [](const cv::Mat& image) {
    cv::Mat result;
    image.convertTo(result, CV_16U, 257.0);
    return result;
  };
  const std::vector<std::pair<std::string, cv::Mat>> images = {
    { enc::MONO8, grey },
    { enc::TYPE_8UC1, grey },
    { enc::MONO16, wide(grey) },
    { enc::TYPE_16UC1, wide(grey) },
    { enc::BGR8, bgr },
    { enc::TYPE_8UC3, bgr },
    { enc::RGB8, convert(cv::COLOR_BGR2RGB) },
    { enc::BGRA8, convert(cv::COLOR_BGR2BGRA) },
    { enc::RGBA8, convert(cv::COLOR_BGR2RGBA) },
    { enc::BGR16, wide(bgr) },
    { enc::RGB16, wide(convert(cv::COLOR_BGR2RGB)) },
    { enc::BGRA16, wide(convert(cv::COLOR_BGR2BGRA)) },
    { enc::RGBA16, wide(convert(cv::COLOR_BGR2RGBA)) },
  };
  for (const auto& [encoding, image] : images)
  {
    const cv::Mat converted = toGrey(toImage(image, encoding, {}), encoding);
    ASSERT_EQ(converted.type(), CV_8UC1) << encoding;
    ASSERT_EQ(converted.size(), grey.size()) << encoding;
    EXPECT_LE(test::largestDifference(converted, grey), 1.0) << encoding;
  }
}

TEST(ImageConversion, TellsAllLevelsOfAFewBitsOfSixteen)
{
  cv::Mat ramp(40, 256, CV_16UC1);  // of 10 bits
  for (int u = 0; u < ramp.cols; ++u)
  {
    ramp.col(u).setTo(4 * u);
  }
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>(3, ramp), colour);
  cv::Mat colours_and_alpha;
  cv::cvtColor(colour, colours_and_alpha, cv::COLOR_BGR2BGRA);
  const cv::Mat grey = toGrey(toImage(ramp, enc::MONO16, {}), "grey");
  for (const auto& [encoding, image] : std::vector<std::pair<std::string, cv::Mat>>{ { enc::RGB16, colour },
                                                                                     { enc::BGR16, colour },
                                                                                     { enc::RGBA16, colours_and_alpha },
                                                                                     { enc::BAYER_RGGB16, ramp } })
  {
    const cv::Mat converted = toGrey(toImage(image, encoding, {}), encoding);
    const cv::Rect inside(2, 2, ramp.cols - 4, ramp.rows - 4);
    EXPECT_LE(test::largestDifference(converted(inside), grey(inside)), 3.0) << encoding;
  }
}

TEST(ImageConversion, ReadsEitherOrderOfBytes)
{
  for (const int type : { CV_16UC1, CV_16UC3 })
  {
    cv::Mat wide(20, 21, type);
    cv::randu(wide, cv::Scalar::all(0), cv::Scalar::all(65536));
    const std::string encoding = type == CV_16UC1 ? enc::MONO16 : enc::RGB16;
    const sensor_msgs::Image little = toImage(wide, encoding, {});
    ASSERT_EQ(little.is_bigendian, 0);
    sensor_msgs::Image big = little;  // with rows that are padded, too
    big.is_bigendian = 1;
    big.step += 6;
    big.data.assign(std::size_t{ big.step } * big.height, 7);
    for (std::size_t row = 0; row < big.height; ++row)
    {
      for (std::size_t i = 0; i < little.step; ++i)
      {
        big.data[row * big.step + (i ^ 1U)] = little.data[row * little.step + i];
      }
    }
    EXPECT_EQ(test::largestDifference(toGrey(big, "big"), toGrey(little, "little")), 0.0) << encoding;
  }
}

TEST(ImageConversion, ShowsColoursToPeople)
{
  const cv::Mat bgr = examplePicture();
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  EXPECT_EQ(cv::norm(toColour(toImage(rgb, enc::RGB8, {}), "colours"), bgr, cv::NORM_INF), 0.0);
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  const cv::Mat shown = toColour(toImage(grey, enc::MONO8, {}), "grey");
  EXPECT_EQ(shown.type(), CV_8UC3);
  sensor_msgs::Image wraps = toImage(bgr, enc::BGR8, {});
  wraps.width = 1;
  wraps.height = 2;
  wraps.step = (1U << 31) + 3;  // whose product wraps to 6 in 32 bits
  wraps.data.resize(6);
  EXPECT_NE(test::thrownMessage<ImageError>([&] { toColour(wraps, "wraps"); }).find("6 bytes"), std::string::npos);
}

TEST(ImageConversion, DemosaicsBayerPatterns)
{
  const cv::Mat bgr = examplePicture();
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  // Channels (of BGR) at the even and odd columns of even rows, then of odd rows.
  const std::vector<std::pair<std::string, std::array<int, 4>>> patterns = {
    { enc::BAYER_RGGB8, { 2, 1, 1, 0 } },
    { enc::BAYER_BGGR8, { 0, 1, 1, 2 } },
    { enc::BAYER_GBRG8, { 1, 0, 2, 1 } },
    { enc::BAYER_GRBG8, { 1, 2, 0, 1 } },
  };
  for (const auto& [encoding, channels] : patterns)
  {
    cv::Mat mosaic(bgr.size(), CV_8UC1);
    for (int v = 0; v < bgr.rows; ++v)
    {
      for (int u = 0; u < bgr.cols; ++u)
      {
        const int channel = channels[static_cast<std::size_t>(2 * (v % 2) + u % 2)];
        mosaic.at<uchar>(v, u) = bgr.at<cv::Vec3b>(v, u)[channel];
      }
    }
    const cv::Mat converted = toGrey(toImage(mosaic, encoding, {}), encoding);
    const cv::Rect inside(2, 2, bgr.cols - 4, bgr.rows - 4);
    EXPECT_LE(test::largestDifference(converted(inside), grey(inside)), 3.0) << encoding;
  }
}

TEST(ImageConversion, DoesNotReferToTheMessage)
{
  sensor_msgs::Image image = toImage(cv::Mat(20, 20, CV_8UC1, cv::Scalar(7)), enc::MONO8, {});
  const cv::Mat grey = toGrey(image, "the image");
  image.data[0] = 99;
  EXPECT_EQ(grey.at<uchar>(0, 0), 7);
}

TEST(ImageConversion, NamesWhatItCannotUse)
{
  const sensor_msgs::Image good = toImage(cv::Mat(20, 20, CV_8UC1, cv::Scalar(7)), enc::MONO8, {});

  sensor_msgs::Image image = good;
  image.encoding = "jpeg";
  EXPECT_NE(errorOf(image).find("'the image': encoding 'jpeg'"), std::string::npos) << errorOf(image);

  image.encoding = "mono\n8";
  EXPECT_NE(errorOf(image).find("'the image': encoding 'mono?8'"), std::string::npos) << errorOf(image);
  EXPECT_EQ(errorOf(image).find('\n'), std::string::npos) << errorOf(image);

  image = good;
  image.data.resize(10);
  EXPECT_NE(errorOf(image).find("'the image': 10 bytes"), std::string::npos) << errorOf(image);

  image = good;
  image.step = 1u << 31;  // with 20 rows, the product wraps to 0 in 32 bits
  image.data.clear();
  EXPECT_NE(errorOf(image).find("'the image': 0 bytes"), std::string::npos) << errorOf(image);

  image = good;
  image.step = 5;
  image.data.resize(100);
  EXPECT_NE(errorOf(image), "");

  image = good;
  image.width = 10000;
  image.height = 10000;
  EXPECT_NE(errorOf(image).find("10000 x 10000"), std::string::npos) << errorOf(image);

  EXPECT_NE(errorOf(toImage(cv::Mat(20, 20, CV_32FC1, cv::Scalar(7)), enc::TYPE_32FC1, {})), "");
  EXPECT_NE(errorOf(toImage(cv::Mat(1, 1, CV_8UC1, cv::Scalar(7)), enc::MONO8, {})), "");
  EXPECT_NE(errorOf(sensor_msgs::Image()), "");
}

TEST(RegionConversion, RefusesWhatLeavesTheImage)
{
  const cv::Size size(640, 480);
  sensor_msgs::RegionOfInterest roi;
  EXPECT_TRUE(toRect(roi, size).empty());
  roi.x_offset = 10;
  roi.y_offset = 20;
  roi.width = 630;
  roi.height = 460;
  EXPECT_EQ(toRect(roi, size), cv::Rect(10, 20, 630, 460));
  EXPECT_EQ(toRegionOfInterest(toRect(roi, size)), roi);
  roi.width = 631;
  EXPECT_THROW(toRect(roi, size), ImageError);
  roi.x_offset = std::numeric_limits<std::uint32_t>::max();
  EXPECT_THROW(toRect(roi, size), ImageError);
  roi.width = 0;
  EXPECT_THROW(toRect(roi, size), ImageError);
}

TEST(PoseConversion, KeepsPositionAndOrientation)
{
  geometry_msgs::TransformStamped transform;
  transform.header.frame_id = "odom";
  transform.child_frame_id = "camera_optical_frame";
  transform.transform.translation.x = 1.0;
  transform.transform.translation.y = -2.0;
  transform.transform.translation.z = 0.5;
  transform.transform.rotation.x = 0.5;
  transform.transform.rotation.y = -0.5;
  transform.transform.rotation.z = 0.5;
  transform.transform.rotation.w = -0.5;

  const geometry_msgs::PoseStamped pose = toPoseStamped(toViewPose(transform), ros::Time(3.0));
  EXPECT_EQ(pose.header.frame_id, "odom");
  EXPECT_EQ(pose.header.stamp, ros::Time(3.0));
  EXPECT_DOUBLE_EQ(pose.pose.position.x, 1.0);
  EXPECT_DOUBLE_EQ(pose.pose.position.y, -2.0);
  EXPECT_DOUBLE_EQ(pose.pose.position.z, 0.5);
  EXPECT_EQ(pose.pose.orientation, transform.transform.rotation);
}

TEST(MatchConversion, CopiesMatchesAndWritesTheMatrixByRows)
{
  ViewMatch match;
  match.outcome = MatchOutcome::MATCHED;
  match.matrix << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 1.0;
  match.matches = { { { { 1.0, 2.0 }, { 3.0, 4.0 } }, 0.5, true }, { { { 5.0, 6.0 }, { 7.0, 8.0 } }, 0.25, false } };
  match.inliers = 1;
  match.rms_error = 0.7;

  const std::vector<PointMatch> points = toPointMatches(match.matches);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].reference_x, 1.0);
  EXPECT_EQ(points[0].reference_y, 2.0);
  EXPECT_EQ(points[0].current_x, 3.0);
  EXPECT_EQ(points[0].current_y, 4.0);
  EXPECT_EQ(points[0].score, 0.5);
  EXPECT_TRUE(points[0].inlier);
  EXPECT_FALSE(points[1].inlier);

  std_msgs::Header header;
  header.stamp = ros::Time(5.0);
  header.frame_id = "camera_optical_frame";
  const Homography homography = toHomography(match, "desk", header);
  EXPECT_EQ(homography.header, header);
  EXPECT_EQ(homography.view, "desk");
  EXPECT_EQ(homography.state, Homography::TRACKING);
  EXPECT_TRUE(homography.valid);
  EXPECT_EQ(homography.h[1], 2.0);
  EXPECT_EQ(homography.h[3], 4.0);
  EXPECT_EQ(homography.matches, 2);
  EXPECT_EQ(homography.inliers, 1);
  EXPECT_EQ(homography.rms_error, 0.7);
  EXPECT_TRUE(std::isnan(homography.distance));
  EXPECT_TRUE(std::isnan(homography.normal.z));
  EXPECT_TRUE(std::isnan(homography.rotation.w));
}

TEST(TrackConversion, TellsWhatIsKnownAndNothingElse)
{
  std_msgs::Header header;
  header.frame_id = "camera";
  PlaneTrack track;
  track.state = TrackingState::TRACKING;
  track.homography.h = 2.0 * Eigen::Matrix3d::Identity();
  track.homography.looked_for = 50;
  track.homography.supporting = 40;
  track.homography.rms = 0.3;
  PlaneEstimate plane;
  plane.motion.rotation = Eigen::AngleAxisd(M_PI / 2.0, Eigen::Vector3d::UnitX()).toRotationMatrix();
  plane.motion.translation_over_distance = { 1.0, 2.0, 3.0 };
  plane.motion.normal = Eigen::Vector3d::UnitZ();
  plane.ambiguous = true;
  track.plane = plane;
  Homography message = toHomography(track, "desk", header, "no reason");
  EXPECT_EQ(message.header, header);
  EXPECT_EQ(message.view, "desk");
  EXPECT_EQ(message.state, Homography::TRACKING);
  EXPECT_TRUE(message.valid);
  EXPECT_EQ(message.reason, "");
  EXPECT_EQ(message.h[4], 2.0);
  EXPECT_EQ(message.matches, 50);
  EXPECT_EQ(message.inliers, 40);
  EXPECT_EQ(message.rms_error, 0.3);
  EXPECT_NEAR(message.rotation.x, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(message.rotation.w, std::sqrt(0.5), 1e-12);
  EXPECT_EQ(message.translation_over_distance.y, 2.0);
  EXPECT_TRUE(std::isnan(message.normal.z));
  EXPECT_TRUE(std::isnan(message.distance));
  EXPECT_TRUE(message.ambiguous);

  track.plane->normal_known = true;
  track.plane->distance = 0.7;
  message = toHomography(track, "desk", header, "");
  EXPECT_EQ(message.normal.z, 1.0);
  EXPECT_EQ(message.distance, 0.7);

  track.state = TrackingState::LOST;
  message = toHomography(track, "desk", header, "it is dark");
  EXPECT_EQ(message.state, Homography::LOST);
  EXPECT_FALSE(message.valid);
  EXPECT_EQ(message.reason, "it is dark");
  EXPECT_TRUE(std::isnan(message.h[0]));
  EXPECT_TRUE(std::isnan(message.rotation.w));
}

TEST(MatchConversion, CopiesLinesAndWritesPlanesByRows)
{
  const std::vector<MatchedLine> lines = {
    { { { 1.0, 2.0 }, { 3.0, 4.0 } }, { { 5.0, 6.0 }, { 7.0, 8.0 } }, 11, 12, 0.75, 1 },
    { { { 0.0, 0.0 }, { 1.0, 0.0 } }, { { 0.0, 1.0 }, { 1.0, 1.0 } }, 13, 14, 0.5, -1 },
  };
  const std::vector<LineMatch> messages = toLineMatches(lines);
  ASSERT_EQ(messages.size(), 2u);
  EXPECT_EQ(messages[0].reference.x1, 1.0);
  EXPECT_EQ(messages[0].reference.y1, 2.0);
  EXPECT_EQ(messages[0].reference.x2, 3.0);
  EXPECT_EQ(messages[0].reference.y2, 4.0);
  EXPECT_EQ(messages[0].current.x1, 5.0);
  EXPECT_EQ(messages[0].current.y1, 6.0);
  EXPECT_EQ(messages[0].current.x2, 7.0);
  EXPECT_EQ(messages[0].current.y2, 8.0);
  EXPECT_EQ(messages[0].score, 0.75);
  EXPECT_EQ(messages[0].plane, 1);
  EXPECT_EQ(messages[1].plane, -1);

  Eigen::Matrix3d h;
  h << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0;
  const std::vector<double> expected = { 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
                                         2.0, 4.0, 6.0, 8.0, 10., 12., 14., 16., 18. };
  EXPECT_EQ(toRowMajor({ h, 2.0 * h }), expected);
  EXPECT_TRUE(toRowMajor({}).empty());
}

TEST(BaseConversion, PutsTheViewsPoseIntoOdometrysFrame)
{
  HomingReport report;
  report.stamp = 12.5;
  report.goal_in_odom = PlanarPose{ 1.0, -2.0, 0.5 };
  report.goal_covariance << 1.0, 2.0, 3.0, 2.0, 5.0, 6.0, 3.0, 6.0, 9.0;
  const geometry_msgs::PoseWithCovarianceStamped message = toViewPose(report, "odom");
  EXPECT_EQ(message.header.frame_id, "odom");
  EXPECT_EQ(message.header.stamp, ros::Time(12.5));
  EXPECT_EQ(message.pose.pose.position.x, 1.0);
  EXPECT_EQ(message.pose.pose.position.y, -2.0);
  EXPECT_NEAR(2.0 * std::atan2(message.pose.pose.orientation.z, message.pose.pose.orientation.w), 0.5, 1e-12);
  EXPECT_EQ(message.pose.covariance[0], 1.0);
  EXPECT_EQ(message.pose.covariance[1], 2.0);
  EXPECT_EQ(message.pose.covariance[5], 3.0);
  EXPECT_EQ(message.pose.covariance[7], 5.0);
  EXPECT_EQ(message.pose.covariance[30], 3.0);
  EXPECT_EQ(message.pose.covariance[35], 9.0);
  EXPECT_EQ(message.pose.covariance[14], 0.0);
}

TEST(BaseConversion, PutsTheBaseIntoTheViewsFrame)
{
  const PlanarPose base_in_odom{ 2.0, 1.0, -0.4 };
  const auto report_of = [&](const PlanarPose& goal_in_odom) {
    HomingReport report;
    report.stamp = 12.5;
    report.goal_in_odom = goal_in_odom;
    const PlanarPose goal = compose(inverse(base_in_odom), goal_in_odom);
    report.heading = goal.heading();
    report.distance = goal.distance();
    report.yaw_error = goal.yaw;
    return report;
  };
  const auto pose_of = [&](const PlanarPose& goal_in_odom) {
    const geometry_msgs::Pose pose = toBasePose(report_of(goal_in_odom), "desk").pose.pose;
    return Eigen::Vector3d(pose.position.x, pose.position.y, 2.0 * std::atan2(pose.orientation.z, pose.orientation.w));
  };
  const PlanarPose goal_in_odom{ 1.0, -2.0, 0.5 };
  const PlanarPose expected = compose(inverse(goal_in_odom), base_in_odom);
  const Eigen::Vector3d pose = pose_of(goal_in_odom);
  EXPECT_LT((pose - Eigen::Vector3d(expected.x, expected.y, expected.yaw)).norm(), 1e-12);

  constexpr double STEP = 1e-6;
  Eigen::Matrix3d jacobian;
  jacobian.col(0) = (pose_of({ 1.0 + STEP, -2.0, 0.5 }) - pose) / STEP;
  jacobian.col(1) = (pose_of({ 1.0, -2.0 + STEP, 0.5 }) - pose) / STEP;
  jacobian.col(2) = (pose_of({ 1.0, -2.0, 0.5 + STEP }) - pose) / STEP;
  HomingReport report = report_of(goal_in_odom);
  report.goal_covariance << 4.0, 1.0, 0.5, 1.0, 2.0, 0.3, 0.5, 0.3, 1.0;
  const Eigen::Matrix3d covariance = jacobian * report.goal_covariance * jacobian.transpose();
  const geometry_msgs::PoseWithCovarianceStamped message = toBasePose(report, "desk");
  EXPECT_EQ(message.header.frame_id, "view_desk");
  EXPECT_EQ(message.header.stamp, ros::Time(12.5));
  EXPECT_NEAR(message.pose.covariance[0], covariance(0, 0), 1e-4);
  EXPECT_NEAR(message.pose.covariance[1], covariance(0, 1), 1e-4);
  EXPECT_NEAR(message.pose.covariance[5], covariance(0, 2), 1e-4);
  EXPECT_NEAR(message.pose.covariance[11], covariance(1, 2), 1e-4);
  EXPECT_NEAR(message.pose.covariance[35], covariance(2, 2), 1e-4);
  EXPECT_EQ(message.pose.covariance[14], 0.0);
}

TEST(MatchConversion, HasNoNumbersWithoutGeometry)
{
  ViewMatch match;
  match.outcome = MatchOutcome::NO_GEOMETRY;
  match.matrix.setIdentity();
  match.inliers = 3;
  match.message = "nothing there";
  const Homography homography = toHomography(match, "desk", std_msgs::Header());
  EXPECT_EQ(homography.state, Homography::SEARCHING);
  EXPECT_FALSE(homography.valid);
  EXPECT_EQ(homography.reason, "nothing there");
  EXPECT_EQ(homography.inliers, 0);
  EXPECT_TRUE(std::isnan(homography.h[0]));
  EXPECT_TRUE(std::isnan(homography.rms_error));
}

}  // namespace
}  // namespace view_servo
