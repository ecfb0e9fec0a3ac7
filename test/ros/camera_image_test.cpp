// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_image.h"

#include "support/compressed_image.h"
#include "support/random_picture.h"
#include "support/textured_plane.h"
#include "support/thrown_message.h"
#include "view_servo/images/image_io.h"
#include "view_servo/ros/camera_faults.h"
#include "view_servo/ros/conversions.h"

#include <gtest/gtest.h>
#include <ros/time.h>
#include <boost/make_shared.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
const std::string TOPIC = "/camera/image_raw/compressed";

CameraImage received(const sensor_msgs::CompressedImage& message)
{
  return { boost::make_shared<const sensor_msgs::CompressedImage>(message), TOPIC };
}

/** What decoding an image says; "" when it can be decoded. */
std::string errorOf(const sensor_msgs::CompressedImage& message)
{
  return thrownMessage<ImageError>([&] { toGrey(received(message)); });
}

/** Red on the left, blue on the right, which have different grey levels. */
cv::Mat redAndBlue()
{
  cv::Mat bgr(32, 64, CV_8UC3, cv::Scalar(0, 0, 250));
  bgr.colRange(32, 64).setTo(cv::Scalar(250, 0, 0));
  return bgr;
}

cv::Mat greyOf(const cv::Mat& bgr)
{
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

TEST(DecodedEncoding, FollowsTheFormat)
{
  EXPECT_EQ(decodedEncoding("rgb8; jpeg compressed bgr8", CV_8UC3), "bgr8");
  EXPECT_EQ(decodedEncoding("bgr8; jpeg compressed bgr8", CV_8UC3), "bgr8");
  EXPECT_EQ(decodedEncoding("rgb8; jpeg compressed rgb8", CV_8UC3), "rgb8");
  EXPECT_EQ(decodedEncoding("bgr8; png compressed", CV_8UC3), "rgb8");  // as old versions of image_transport do it
  EXPECT_EQ(decodedEncoding("rgb16; png compressed bgr16", CV_16UC3), "bgr16");
  EXPECT_EQ(decodedEncoding("rgba8; png compressed rgba8", CV_8UC4), "rgba8");
  EXPECT_EQ(decodedEncoding("mono8; jpeg compressed ", CV_8UC1), "mono8");
  EXPECT_EQ(decodedEncoding("mono16; png compressed ", CV_16UC1), "mono16");
  EXPECT_EQ(decodedEncoding("16UC1; png compressed ", CV_16UC1), "mono16");
  EXPECT_EQ(decodedEncoding("bayer_rggb8; jpeg compressed ", CV_8UC1), "bayer_rggb8");
  EXPECT_EQ(decodedEncoding("bayer_rggb8; jpeg compressed bgr8", CV_8UC3), "bgr8");
  EXPECT_EQ(decodedEncoding("bayer_rggb16; png compressed ", CV_8UC1), "mono8");
  for (const std::string format : { "jpeg", "png", "", ";", "h264; ", "a b c" })
  {
    EXPECT_EQ(decodedEncoding(format, CV_8UC3), "bgr8") << format;
    EXPECT_EQ(decodedEncoding(format, CV_8UC1), "mono8") << format;
  }
}

TEST(CompressedImage, IsDecodedToGrey)
{
  const cv::Mat bgr = redAndBlue();
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  const cv::Mat grey = greyOf(bgr);
  ASSERT_GT(std::abs(grey.at<unsigned char>(5, 5) - grey.at<unsigned char>(5, 60)), 40) << "colours tell nothing";
  constexpr double OF_JPEG = 6.0;
  for (const std::string format : { "rgb8; jpeg compressed bgr8", "bgr8; jpeg compressed bgr8", "jpeg" })
  {
    EXPECT_LT(largestDifference(toGrey(received(compressed(bgr, ".jpg", format))), grey), 60.0) << format;
    EXPECT_LT(
        largestDifference(toGrey(received(compressed(bgr, ".jpg", format))).colRange(0, 16), grey.colRange(0, 16)),
        OF_JPEG)
        << format;
    EXPECT_LE(largestDifference(toGrey(received(compressed(bgr, ".png", format))), grey), 0.0) << "the data decides";
  }
  EXPECT_LE(largestDifference(toGrey(received(compressed(bgr, ".png", "bgr8; png compressed bgr8"))), grey), 0.0);
  EXPECT_LE(largestDifference(toGrey(received(compressed(rgb, ".png", "rgb8; png compressed rgb8"))), grey), 0.0);
  EXPECT_GT(largestDifference(toGrey(received(compressed(rgb, ".png", "png"))), grey), 40.0);
  EXPECT_LE(largestDifference(toGrey(received(compressed(grey, ".png", "mono8; png compressed "))), grey), 0.0);
  EXPECT_LT(largestDifference(toGrey(received(compressed(texturedPicture(1), ".jpg", "mono8; jpeg compressed "))),
                              texturedPicture(1)),
            60.0);
}

TEST(CompressedImage, OfABayerMosaicIsGreyEverywhere)
{
  // A grey surface behind a mosaic of filters that let half of the light through where they are red and blue.
  cv::Mat mosaic(32, 32, CV_8U, cv::Scalar(200));
  const cv::Mat grey = toGrey(received(compressed(mosaic, ".png", "bayer_rggb8; png compressed ")));
  EXPECT_EQ(grey.size(), mosaic.size());
  EXPECT_LE(largestDifference(grey, mosaic), 1.0);
}

TEST(CompressedImage, TellsItsSizeBeforeItIsDecoded)
{
  const CameraImage image = received(compressed(texturedPicture(1), ".jpg", "jpeg"));
  EXPECT_EQ(image.width, static_cast<std::uint32_t>(texturedPicture(1).cols));
  EXPECT_EQ(image.height, static_cast<std::uint32_t>(texturedPicture(1).rows));
  EXPECT_EQ(image.encoding, "jpeg");
  EXPECT_EQ(image.fault, "");
}

TEST(CompressedImage, ThatIsDamagedIsRefusedInOneLineThatNamesTopicAndCause)
{
  const sensor_msgs::CompressedImage whole = compressed(texturedPicture(1), ".jpg", "mono8; jpeg compressed ");
  const auto spoilt = [&](const std::function<void(sensor_msgs::CompressedImage&)>& spoil) {
    sensor_msgs::CompressedImage message = whole;
    spoil(message);
    return errorOf(message);
  };
  EXPECT_EQ(spoilt([](sensor_msgs::CompressedImage&) {}), "");
  for (const std::string& error : {
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.clear(); }),
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.resize(1); }),
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.resize(100); }),
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.resize(message.data.size() / 2); }),
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.assign(5000, 0); }),
           spoilt([](sensor_msgs::CompressedImage& message) { message.data.assign(5000, 0xFF); }),
       })
  {
    EXPECT_NE(error.find("'" + TOPIC + "' is not an image, or is damaged"), std::string::npos) << error;
    EXPECT_NE(error.find("format 'mono8; jpeg compressed '"), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  sensor_msgs::CompressedImage depth = whole;
  depth.format = "32FC1; compressedDepth png";
  EXPECT_NE(errorOf(depth).find("depth image"), std::string::npos) << errorOf(depth);
  EXPECT_NE(received(depth).fault, "");
  sensor_msgs::CompressedImage odd = whole;
  odd.format = "mono8;\njpeg";
  odd.data.resize(100);
  EXPECT_NE(errorOf(odd).find("format 'mono8;?jpeg'"), std::string::npos) << errorOf(odd);
  EXPECT_EQ(errorOf(odd).find('\n'), std::string::npos) << errorOf(odd);
}

TEST(CompressedImage, WithTooManyPixelsIsRefusedByItsHeader)
{
  for (const sensor_msgs::CompressedImage& bomb : { pngOfSize(60000, 60000), pngOfSize(4000000000U, 4000000000U),
                                                    jpegOfSize(65500, 65500), jpegOfSize(65500, 800) })
  {
    const CameraImage image = received(bomb);
    EXPECT_NE(image.fault.find("megapixels"), std::string::npos) << image.fault;
    EXPECT_NE(image.fault.find(TOPIC), std::string::npos) << image.fault;
    EXPECT_EQ(errorOf(bomb), image.fault);
  }
  EXPECT_NE(received(pngOfSize(3, 3)).fault.find("at least"), std::string::npos);
  EXPECT_EQ(received(pngOfSize(640, 480)).fault, "");
  EXPECT_NE(errorOf(pngOfSize(640, 480)), "") << "the data is that of another image";
}

TEST(FaultOfAge, NamesTheClockOfTheBag)
{
  ros::Time::init();
  const auto faultAt = [](double age) {
    return faultOfAge(ros::Time::now() - ros::Duration(age), "/camera", 1.0);
  };
  EXPECT_EQ(faultAt(0.0), "");
  EXPECT_NE(faultAt(5.0), "");
  EXPECT_EQ(faultAt(5.0).find("use_sim_time"), std::string::npos) << faultAt(5.0);
  EXPECT_NE(faultAt(1e6).find("use_sim_time"), std::string::npos) << faultAt(1e6);
  EXPECT_NE(faultAt(1e6).find("--clock"), std::string::npos) << faultAt(1e6);
  EXPECT_EQ(faultAt(-1e6).find("use_sim_time"), std::string::npos) << faultAt(-1e6);

  const ros::Time present = ros::Time::now();
  ros::Time::setNow(present);  // as with use_sim_time
  EXPECT_NE(faultAt(1e6), "");
  EXPECT_EQ(faultAt(1e6).find("use_sim_time"), std::string::npos) << faultAt(1e6);
  ros::Time::useSystemTime();
}

}  // namespace
}  // namespace test
}  // namespace view_servo
