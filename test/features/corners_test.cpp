// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/corners.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace
{
using view_servo::Corner;
using view_servo::CornerParams;
using view_servo::detectCorners;
using view_servo::test::texturedPicture;

double nearest(const std::vector<Corner>& corners, const Eigen::Vector2d& point)
{
  double best = std::numeric_limits<double>::infinity();
  for (const Corner& corner : corners)
  {
    best = std::min(best, (corner.position - point).norm());
  }
  return best;
}

/** A bright square whose corners lie at (41.3, 32.6) and 30 px to the right and below, drawn with exact coverage. */
cv::Mat square()
{
  const int over = 20;
  cv::Mat large(100 * over, 120 * over, CV_8UC1, cv::Scalar(40));
  // Pixel centres are at whole numbers, so pixel u covers u - 0.5 .. u + 0.5.
  const auto at = [&](double x) {
    return static_cast<int>(std::lround((x + 0.5) * over));
  };
  large(cv::Range(at(32.6), at(62.6)), cv::Range(at(41.3), at(71.3))).setTo(200);
  cv::Mat image;
  cv::resize(large, image, cv::Size(120, 100), 0.0, 0.0, cv::INTER_AREA);
  return image;
}

CornerParams strongOnly()
{
  CornerParams params;
  params.relative_threshold = 0.01;  // along edges the measure is zero but for rounding
  return params;
}

TEST(Corners, FindsTheFourCornersOfASquareAndNothingElse)
{
  const std::vector<Corner> corners = detectCorners(square(), strongOnly());
  ASSERT_EQ(corners.size(), 4U);
  // The measure peaks inside the corner, by about the window's size.
  for (const Eigen::Vector2d& truth : { Eigen::Vector2d(41.3, 32.6), Eigen::Vector2d(71.3, 32.6),
                                        Eigen::Vector2d(71.3, 62.6), Eigen::Vector2d(41.3, 62.6) })
  {
    EXPECT_LT(nearest(corners, truth), 1.6);
  }
}

TEST(Corners, AreExactToAFractionOfAPixel)
{
  // The detector moves all four corners inwards alike, so that their middle is that of the square.
  const std::vector<Corner> corners = detectCorners(square(), strongOnly());
  ASSERT_EQ(corners.size(), 4U);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Corner& corner : corners)
  {
    middle += corner.position / 4.0;
  }
  EXPECT_NEAR(middle.x(), 56.3, 0.05);
  EXPECT_NEAR(middle.y(), 47.6, 0.05);
}

TEST(Corners, AreSortedByStrengthAndLimitedInNumber)
{
  CornerParams params;
  params.max_corners = 50;
  const std::vector<Corner> corners = detectCorners(texturedPicture(1), params);
  ASSERT_EQ(corners.size(), 50U);
  EXPECT_TRUE(std::is_sorted(corners.begin(), corners.end(),
                             [](const Corner& a, const Corner& b) { return a.response > b.response; }));
}

TEST(Corners, KeepTheirDistance)
{
  CornerParams params;
  params.min_distance = 7.5;
  const std::vector<Corner> corners = detectCorners(texturedPicture(2), params);
  ASSERT_GT(corners.size(), 100U);
  for (std::size_t i = 0; i < corners.size(); ++i)
  {
    for (std::size_t j = 0; j < i; ++j)
    {
      EXPECT_GE((corners[i].position - corners[j].position).norm(), 7.5);
    }
  }
}

TEST(Corners, StayWithinTheMaskAndTheBorder)
{
  cv::Mat mask = cv::Mat::zeros(360, 480, CV_8UC1);
  mask(cv::Rect(100, 80, 150, 120)).setTo(255);
  const std::vector<Corner> masked = detectCorners(texturedPicture(3), CornerParams(), mask);
  ASSERT_GT(masked.size(), 20U);
  for (const Corner& corner : masked)
  {
    EXPECT_GE(corner.position.x(), 99.0);
    EXPECT_LE(corner.position.x(), 250.0);
    EXPECT_GE(corner.position.y(), 79.0);
    EXPECT_LE(corner.position.y(), 200.0);
  }
  CornerParams params;
  params.border = 40;
  for (const Corner& corner : detectCorners(texturedPicture(3), params))
  {
    EXPECT_GE(corner.position.minCoeff(), 39.0);
    EXPECT_LE(corner.position.x(), 480.0 - 40.0);
    EXPECT_LE(corner.position.y(), 360.0 - 40.0);
  }
}

TEST(Corners, RepeatUnderNoiseAndLight)
{
  const cv::Mat picture = texturedPicture(4);
  CornerParams params;
  params.max_corners = 200;
  const std::vector<Corner> before = detectCorners(picture, params);
  const std::vector<Corner> after = detectCorners(view_servo::test::disturbed(picture, 0.7, 20.0, 3.0), params);
  const auto repeated = std::count_if(before.begin(), before.end(),
                                      [&](const Corner& corner) { return nearest(after, corner.position) < 0.5; });
  EXPECT_GT(repeated, 160);
}

TEST(Corners, DoNotDependOnTheNumberOfThreads)
{
  const cv::Mat picture = texturedPicture(5);
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const std::vector<Corner> one = detectCorners(picture, CornerParams());
  cv::setNumThreads(3);
  const std::vector<Corner> three = detectCorners(picture, CornerParams());
  cv::setNumThreads(threads);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i)
  {
    EXPECT_EQ(one[i].position, three[i].position);
  }
}

TEST(Corners, OfAnEmptySceneAreNone)
{
  EXPECT_TRUE(detectCorners(cv::Mat(100, 100, CV_8UC1, cv::Scalar(90)), CornerParams()).empty());
  EXPECT_TRUE(detectCorners(cv::Mat(1, 1, CV_8UC1, cv::Scalar(90)), CornerParams()).empty());
}

TEST(Corners, RefuseOtherImages)
{
  EXPECT_THROW(detectCorners(cv::Mat(50, 50, CV_8UC3), CornerParams()), std::invalid_argument);
  EXPECT_THROW(detectCorners(cv::Mat(50, 50, CV_32FC1), CornerParams()), std::invalid_argument);
  EXPECT_THROW(detectCorners(cv::Mat(50, 50, CV_8UC1, cv::Scalar(0)), CornerParams(), cv::Mat(50, 49, CV_8UC1)),
               std::invalid_argument);
}

TEST(CornerParams, NameEveryFault)
{
  EXPECT_TRUE(CornerParams().validate().empty());
  CornerParams params;
  params.max_corners = 0;
  params.derivative_sigma = 0.0;
  params.integration_sigma = -1.0;
  params.k = 0.25;
  params.min_distance = -1.0;
  params.relative_threshold = 1.0;
  params.border = 0;
  EXPECT_EQ(params.validate().size(), 7U);
}

}  // namespace
