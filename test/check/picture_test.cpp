// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/picture.h"
#include "check/report.h"
#include "check/stream_meter.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <string>

namespace view_servo::check
{
namespace
{
/** Rectangles of random places, sizes and greys, with noise. */
cv::Mat rectangles(double blur)
{
  cv::RNG generator(7);
  cv::Mat picture(480, 640, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 60; ++i)
  {
    const cv::Rect area(generator.uniform(0, 560), generator.uniform(0, 420), generator.uniform(30, 80),
                        generator.uniform(30, 60));
    cv::rectangle(picture, area, cv::Scalar(generator.uniform(20, 236)), cv::FILLED);
  }
  if (blur > 0.0)
  {
    cv::GaussianBlur(picture, picture, cv::Size(), blur);
  }
  cv::Mat noise(picture.size(), CV_8SC1);
  generator.fill(noise, cv::RNG::NORMAL, 0.0, 2.0);
  cv::add(picture, noise, picture, cv::noArray(), CV_8U);
  return picture;
}

TEST(CheckPicture, MeasuresTheWidthOfEdges)
{
  EXPECT_LT(edgeWidth(rectangles(0.0)), 0.8);
  for (const double blur : { 1.5, 2.5, 4.0 })
  {
    EXPECT_NEAR(edgeWidth(rectangles(blur)), blur, 0.25 * blur);
  }
  EXPECT_TRUE(std::isnan(edgeWidth(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)))));
}

TEST(CheckPicture, MeasuresLightAndFeatures)
{
  const PictureMeasures well = measurePicture(rectangles(0.0));
  EXPECT_EQ(well.lack_of_light, "");
  EXPECT_GT(well.corners, 100);
  EXPECT_GT(well.segments, 50);
  EXPECT_LT(well.overexposed, 0.01);
  const PictureMeasures black = measurePicture(cv::Mat(480, 640, CV_8UC1, cv::Scalar(4)));
  EXPECT_EQ(black.lack_of_light, "nearly black");
  cv::Mat half_white = rectangles(0.0);
  half_white.colRange(0, 320).setTo(255);
  EXPECT_NEAR(measurePicture(half_white).overexposed, 0.5, 0.02);
}

TEST(CheckPicture, DrawsCornersAndSegments)
{
  const cv::Mat grey = rectangles(0.0);
  const cv::Mat drawing = drawPicture(grey, "text");
  EXPECT_EQ(drawing.type(), CV_8UC3);
  EXPECT_EQ(drawing.cols, grey.cols);
  EXPECT_GT(drawing.rows, grey.rows);
  cv::Mat plain;
  cv::cvtColor(grey, plain, cv::COLOR_GRAY2BGR);
  cv::Mat difference;
  cv::absdiff(plain, drawing.rowRange(0, grey.rows), difference);
  EXPECT_GT(cv::sum(difference)[0], 0.0);
}

TEST(CheckStreams, MeasuresRateGapAgeAndOrder)
{
  StreamMeter meter;
  StreamObservations stream;
  meter.fill(stream);
  EXPECT_EQ(stream.count, 0);
  for (int i = 0; i <= 40; ++i)
  {
    meter.add(100.0 + 0.1 * i + (i > 20 ? 0.5 : 0.0), i % 4 == 0 ? 0.5 : 0.02, i % 10 == 9);
  }
  meter.fill(stream);
  EXPECT_EQ(stream.count, 41);
  EXPECT_NEAR(stream.rate, 40.0 / 4.5, 1e-9);
  EXPECT_NEAR(stream.usual_gap, 0.1, 1e-9) << "one pause is not usual";
  EXPECT_NEAR(stream.age, 0.02, 1e-9);
  EXPECT_NEAR(stream.late_share, 4.0 / 41.0, 1e-9);
}

TEST(CheckStreams, MeasuresRest)
{
  RestMeter meter;
  OdometryObservations odometry;
  meter.fill(odometry);
  EXPECT_TRUE(std::isnan(odometry.moved));
  meter.add(1.0, 2.0, M_PI - 0.01);
  meter.add(1.01, 2.0, -M_PI + 0.01);
  meter.fill(odometry);
  EXPECT_NEAR(odometry.moved, 0.01, 1e-12);
  EXPECT_NEAR(odometry.turned, 0.02, 1e-12) << "across pi";
  EXPECT_NEAR(odometry.position_noise, 0.005, 1e-12);
  EXPECT_NEAR(odometry.yaw_noise, 0.01, 1e-12);
}

TEST(CheckReport, HasColumnsAndASummary)
{
  const Findings findings = { ok("images", "10 Hz"), warning("sharpness", "blurred", "focus"),
                              error("tf", "unknown", "publish it") };
  EXPECT_EQ(toLines(findings),
            "ok       images            10 Hz\n"
            "WARNING  sharpness         blurred\n"
            "                           -> focus\n"
            "ERROR    tf                unknown\n"
            "                           -> publish it\n");
  EXPECT_EQ(summary(findings), "1 ok, 1 warning, 1 error");
  EXPECT_EQ(exitStatus(findings), 2);
  EXPECT_EQ(exitStatus({ findings[0], findings[1] }), 1);
  EXPECT_EQ(exitStatus({ findings[0] }), 0);
}

}  // namespace
}  // namespace view_servo::check
