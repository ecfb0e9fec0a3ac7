// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/image_io.h"

#include "support/random_picture.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <utility>
#include <vector>

using view_servo::ImageError;
using view_servo::readGreyImage;
using view_servo::toGrey;
using view_servo::test::largestDifference;
using view_servo::test::randomPicture;
using view_servo::test::readText;
using view_servo::test::TemporaryDirectory;
using view_servo::test::thrownMessage;
using view_servo::test::writeText;

namespace
{
cv::Mat randomImage(int type, const cv::Size& size = cv::Size(40, 30))
{
  return randomPicture(7, size, type);
}

class ImageIoTest : public ::testing::Test
{
protected:
  std::string path(const std::string& name) const
  {
    return directory_.path() / name;
  }

  std::string writeImage(const std::string& name, const cv::Mat& image) const
  {
    EXPECT_TRUE(cv::imwrite(path(name), image));
    return path(name);
  }

  std::string writeBytes(const std::string& name, const std::string& bytes) const
  {
    return writeText(path(name), bytes);
  }

  /** The first `fraction` of a file. */
  std::string cutShort(const std::string& whole, const std::string& name, double fraction) const
  {
    const std::string bytes = readText(whole);
    return writeBytes(name, bytes.substr(0, static_cast<std::size_t>(fraction * static_cast<double>(bytes.size()))));
  }

  /** One line that names the file and has `reason` in it. */
  static void expectRefused(const std::string& file, const std::string& reason)
  {
    const std::string error = thrownMessage<ImageError>([&] { readGreyImage(file); });
    EXPECT_NE(error.find(file), std::string::npos) << error;
    EXPECT_NE(error.find(reason), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }

private:
  TemporaryDirectory directory_;
};

}  // namespace

TEST(ToGrey, SharesGreyImages)
{
  const cv::Mat image = randomImage(CV_8UC1);
  EXPECT_EQ(toGrey(image, "image").data, image.data);
}

TEST(ToGrey, WeighsColours)
{
  const cv::Mat blue(20, 20, CV_8UC3, cv::Scalar(255, 0, 0));
  const cv::Mat green(20, 20, CV_8UC3, cv::Scalar(0, 255, 0));
  EXPECT_EQ(toGrey(blue, "image").type(), CV_8UC1);
  EXPECT_EQ(toGrey(blue, "image").at<uchar>(3, 3), 29);
  EXPECT_EQ(toGrey(green, "image").at<uchar>(3, 3), 150);
}

TEST(ToGrey, IgnoresTransparency)
{
  const cv::Mat image = randomImage(CV_8UC4);
  cv::Mat opaque;
  cv::cvtColor(image, opaque, cv::COLOR_BGRA2BGR);
  EXPECT_EQ(largestDifference(toGrey(image, "image"), toGrey(opaque, "image")), 0.0);
}

TEST(ToGrey, MapsTheWhole16BitRange)
{
  cv::Mat image(16, 16, CV_16UC1, cv::Scalar(65535));
  image.at<ushort>(0, 0) = 0;
  image.at<ushort>(0, 1) = 128 * 257;
  const cv::Mat grey = toGrey(image, "image");
  EXPECT_EQ(grey.type(), CV_8UC1);
  EXPECT_EQ(grey.at<uchar>(0, 0), 0);
  EXPECT_EQ(grey.at<uchar>(0, 1), 128);
  EXPECT_EQ(grey.at<uchar>(5, 5), 255);
}

TEST(ToGrey, StretchesAPartOfThe16BitRange)
{
  const cv::Mat picture = randomImage(CV_8UC1, { 80, 60 });
  for (const auto& [scale, offset] :
       { std::pair(4.0, 0.0), std::pair(16.0, 0.0), std::pair(3.0, 200.0), std::pair(1.0, 3000.0) })
  {
    cv::Mat image;
    picture.convertTo(image, CV_16U, scale, offset);
    const cv::Mat grey = toGrey(image, "image");
    double low = 0.0;
    double high = 0.0;
    cv::minMaxLoc(grey, &low, &high);
    EXPECT_GT(high - low, 180.0) << scale;
    // Brighter stays brighter, by the same steps.
    EXPECT_NEAR(grey.at<uchar>(3, 3) - grey.at<uchar>(5, 5),
                (picture.at<uchar>(3, 3) - picture.at<uchar>(5, 5)) * (high - low) / 255.0, 2.0);
  }
  const cv::Mat noise = toGrey(cv::Mat(60, 80, CV_16UC1, cv::Scalar(3000)), "image");
  EXPECT_EQ(cv::countNonZero(noise != noise.at<uchar>(0, 0)), 0);
}

TEST(LackOfLight, IsToldOfPicturesThatShowNothing)
{
  using view_servo::lackOfLight;
  EXPECT_EQ(lackOfLight(randomImage(CV_8UC1, { 80, 60 })), "");
  EXPECT_EQ(lackOfLight(cv::Mat(60, 80, CV_8UC1, cv::Scalar(3))), "nearly black");
  EXPECT_EQ(lackOfLight(cv::Mat(60, 80, CV_8UC1, cv::Scalar(250))), "nearly white");
  cv::Mat even(60, 80, CV_8UC1, cv::Scalar(120));
  even.at<uchar>(3, 3) = 255;  // one spot is no picture
  EXPECT_EQ(lackOfLight(even), "nearly the same everywhere");
}

TEST(ToGrey, RefusesOtherTypes)
{
  EXPECT_THROW(toGrey(cv::Mat(), "image"), ImageError);
  EXPECT_THROW(toGrey(cv::Mat(20, 20, CV_32FC1, cv::Scalar(0.5)), "image"), ImageError);
  EXPECT_THROW(toGrey(cv::Mat(20, 20, CV_8SC1, cv::Scalar(1)), "image"), ImageError);
  EXPECT_THROW(toGrey(cv::Mat(20, 20, CV_8UC2, cv::Scalar(1, 1)), "image"), ImageError);
}

TEST(ToGrey, RefusesSizesBeyondTheLimits)
{
  EXPECT_NO_THROW(toGrey(randomImage(CV_8UC1, { 16, 16 }), "image"));
  EXPECT_THROW(toGrey(randomImage(CV_8UC1, { 15, 200 }), "image"), ImageError);
  EXPECT_THROW(toGrey(randomImage(CV_8UC1, { 200, 15 }), "image"), ImageError);
  EXPECT_NO_THROW(toGrey(cv::Mat(5000, 10000, CV_8UC1), "image"));
  EXPECT_THROW(toGrey(cv::Mat(5001, 10000, CV_8UC1), "image"), ImageError);
}

TEST_F(ImageIoTest, ReadsGreyLosslessly)
{
  const cv::Mat image = randomImage(CV_8UC1);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("grey.png", image)), image), 0.0);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("grey.pgm", image)), image), 0.0);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("grey.bmp", image)), image), 0.0);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("grey.tiff", image)), image), 0.0);
}

TEST_F(ImageIoTest, ReadsPnmWithComments)
{
  const std::string pixels(20 * 16, 'x');
  const cv::Mat image = readGreyImage(writeBytes("a.pgm", "P5\n# made by hand\n20 # wide\n16\n255\n" + pixels));
  EXPECT_EQ(image.size(), cv::Size(20, 16));
  EXPECT_EQ(image.at<uchar>(0, 0), 'x');
}

TEST_F(ImageIoTest, ConvertsWhatItReads)
{
  for (const int type : { CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4 })
  {
    const cv::Mat image = randomImage(type);
    const cv::Mat grey = readGreyImage(writeImage("image.png", image));
    EXPECT_EQ(grey.type(), CV_8UC1) << cv::typeToString(type);
    EXPECT_EQ(largestDifference(grey, toGrey(image, "image")), 0.0) << cv::typeToString(type);
  }
}

TEST_F(ImageIoTest, ReadsGreyWithAlpha)
{
  // OpenCV writes no such files, so here is one: 16 x 16 pixels of grey 100 and alpha 255.
  static constexpr std::array<unsigned char, 75> png{
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00, 0x00,
    0x10, 0x00, 0x00, 0x00, 0x10, 0x08, 0x04, 0x00, 0x00, 0x00, 0xb5, 0xfa, 0x37, 0xea, 0x00, 0x00, 0x00, 0x12, 0x49,
    0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0x48, 0xf9, 0x8f, 0x1f, 0x32, 0x8c, 0x2a, 0x18, 0x49, 0x0a, 0x00, 0xe1, 0xf3,
    0x63, 0x10, 0x34, 0x90, 0x4c, 0x6f, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82
  };
  const cv::Mat grey = readGreyImage(writeBytes("grey_alpha.png", std::string(png.begin(), png.end())));
  EXPECT_EQ(largestDifference(grey, cv::Mat(16, 16, CV_8UC1, cv::Scalar(100))), 0.0);
}

TEST_F(ImageIoTest, ReadsJpeg)
{
  cv::Mat image;
  cv::GaussianBlur(randomImage(CV_8UC3, { 200, 100 }), image, cv::Size(), 4.0);
  EXPECT_LT(largestDifference(readGreyImage(writeImage("image.jpg", image)), toGrey(image, "image")), 8.0);
  EXPECT_TRUE(cv::imwrite(path("progressive.jpg"), image, { cv::IMWRITE_JPEG_PROGRESSIVE, 1 }));
  EXPECT_LT(largestDifference(readGreyImage(path("progressive.jpg")), toGrey(image, "image")), 8.0);
}

TEST_F(ImageIoTest, ReadsJpegWithSomethingBehindIt)
{
  const std::string file = writeImage("phone.jpg", randomImage(CV_8UC3, { 200, 100 }));
  const cv::Mat alone = readGreyImage(file);
  std::ofstream(file, std::ios::app | std::ios::binary) << "a film, with \xFF\xDA somewhere";
  EXPECT_EQ(largestDifference(readGreyImage(file), alone), 0.0);
}

TEST_F(ImageIoTest, RefusesWhatIsNotAFile)
{
  expectRefused(path("nothing.png"), "No such file");
  expectRefused(path("."), "not a file");
  expectRefused("/dev/zero", "not a file");
}

TEST_F(ImageIoTest, RefusesFilesItMayNotRead)
{
  if (geteuid() == 0)
  {
    GTEST_SKIP() << "root may read everything";
  }
  const std::string file = writeImage("secret.png", randomImage(CV_8UC1));
  std::filesystem::permissions(file, std::filesystem::perms::none);
  expectRefused(file, "ermission denied");
}

TEST_F(ImageIoTest, RefusesWhatIsNotAnImage)
{
  expectRefused(writeBytes("empty.png", ""), "not an image");
  expectRefused(writeBytes("text.png", "a b c\n"), "not an image");
  expectRefused(writeBytes("text.pgm", "P5 wide high"), "not an image");
  expectRefused(writeBytes("signature.png", "\x89PNG\r\n\x1a\n"), "not an image");
  expectRefused(writeBytes("signature.jpg", "\xFF\xD8\xFF"), "not an image");
}

TEST_F(ImageIoTest, RefusesImagesCutShort)
{
  for (const std::string extension : { ".png", ".jpg", ".pgm" })
  {
    const std::string whole = writeImage("whole" + extension, randomImage(CV_8UC1, { 200, 100 }));
    expectRefused(cutShort(whole, "cut" + extension, 0.9), "not an image");
    expectRefused(cutShort(whole, "cut" + extension, 0.5), "not an image");
  }
}

TEST_F(ImageIoTest, RefusesFloatImages)
{
  expectRefused(writeImage("float.tiff", cv::Mat(20, 20, CV_32FC1, cv::Scalar(0.5))), "neither 8 nor 16 bits");
}

TEST_F(ImageIoTest, RefusesTinyImages)
{
  expectRefused(writeImage("tiny.png", randomImage(CV_8UC1, { 1, 1 })), "1 x 1");
  expectRefused(writeImage("narrow.bmp", randomImage(CV_8UC1, { 200, 2 })), "200 x 2");
}

TEST_F(ImageIoTest, RefusesHugeImagesByTheirHeaderAlone)
{
  // Only headers: had anything been decoded, these would be called damaged.
  using namespace std::string_literals;
  const std::string png = "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x27\x10\0\0\x27\x10\x08\0\0\0\0"s;
  expectRefused(writeBytes("huge.png", png), "10000 x 10000");
  const std::string jpeg = "\xFF\xD8\xFF\xE0\0\x04xx\xFF\xFF\xC2\0\x0B\x08\x27\x10\x27\x10"s;
  expectRefused(writeBytes("huge.jpg", jpeg), "10000 x 10000");
  expectRefused(writeBytes("huge.ppm", "P6\n10000 10000\n255\n"), "over 50 megapixels");
  expectRefused(writeBytes("overflow.pgm", "P5\n4294967297 4294967297\n255\n"), "over 50 megapixels");
}

TEST_F(ImageIoTest, RefusesHugeBmpAndTiffByTheirHeaderAlone)
{
  using namespace std::string_literals;
  const std::string bmp = "BM"s + std::string(12, '\0') + "\x28\0\0\0\x10\x27\0\0\xF0\xD8\xFF\xFF"s;  // 10000 x -10000
  expectRefused(writeBytes("huge.bmp", bmp), "10000 x 10000");
  const std::string old_bmp = "BM"s + std::string(12, '\0') + "\x0C\0\0\0\x10\x27\x10\x27"s;
  expectRefused(writeBytes("old.bmp", old_bmp), "10000 x 10000");
  const std::string tiff = "II*\0\x08\0\0\0\x02\0"s + "\0\1\4\0\1\0\0\0\x10\x27\0\0"s + "\1\1\3\0\1\0\0\0\x10\x27\0\0"s;
  expectRefused(writeBytes("huge.tif", tiff), "10000 x 10000");
  const std::string other_order = "MM\0*\0\0\0\x08\0\x03"s + "\1\0\0\3\0\0\0\1\0\x20\0\0"s +
                                  "\1\1\0\3\0\0\0\1\0\x20\0\0"s + "\1\x16\0\4\0\0\0\1\x10\0\0\0"s;
  expectRefused(writeBytes("strips.tif", other_order), "32 x 268435456");
}

TEST_F(ImageIoTest, ReadsTiffAndBmp)
{
  const cv::Mat image = randomImage(CV_8UC1);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("a.tiff", image)), image), 0.0);
  EXPECT_EQ(largestDifference(readGreyImage(writeImage("a.bmp", image)), image), 0.0);
}

TEST_F(ImageIoTest, RefusesFormatsThatCannotTellTheirSize)
{
  expectRefused(writeBytes("a.pfm", "Pf\n16000 16000\n-1.0\n"), "not an image");
  expectRefused(writeBytes("a.exr", "\x76\x2f\x31\x01 and so on"), "not an image");
  expectRefused(writeImage("a.webp", randomImage(CV_8UC3)), "PNG, JPEG, PNM, BMP and TIFF are read");
}

TEST_F(ImageIoTest, DoesNotWaitForAPipe)
{
  ASSERT_EQ(mkfifo(path("pipe.png").c_str(), 0600), 0);
  expectRefused(path("pipe.png"), "not a file");
}
