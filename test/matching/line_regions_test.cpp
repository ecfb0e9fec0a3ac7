// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_regions.h"

#include "support/textured_plane.h"
#include "view_servo/features/line_segments.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

namespace view_servo
{
namespace
{
const cv::Size SIZE(640, 480);

LineFeatures features(const cv::Mat& image)
{
  return { image, detectLineSegments(image, LineSegmentParams()), LineFeatureParams() };
}

/** All segments, each matched with itself. */
LineRegion everything(const LineFeatures& image, const Eigen::Matrix3d& h)
{
  LineRegion region{ h, {}, 0.0 };
  for (int i = 0; i < static_cast<int>(image.segments().size()); ++i)
  {
    region.matches.push_back({ i, i, 1.0, 1.0 });
  }
  return region;
}

std::array<LineEvidence, LINE_DIRECTIONS> evidence(const LineFeatures& image, const Eigen::Matrix3d& h,
                                                   std::vector<char> others = {})
{
  others.resize(image.segments().size());
  return evidenceOf(everything(image, h), image, image, others, LineRegionParams());
}

/** Upright posts of different widths and greys, higher than the picture. */
cv::Mat posts()
{
  std::mt19937 random(3);
  std::uniform_int_distribution<int> width(8, 30);
  std::uniform_int_distribution<int> grey(20, 235);
  cv::Mat picture(SIZE, CV_8UC1, cv::Scalar(128));
  for (int left = 0; left < SIZE.width;)
  {
    const int right = std::min(left + width(random), SIZE.width);
    picture.colRange(left, right).setTo(grey(random));
    left = right;
  }
  cv::GaussianBlur(picture, picture, cv::Size(), 1.0);
  return picture;
}

}  // namespace

TEST(LineEvidence, IsLargeInAllDirectionsWhereAPictureIsItself)
{
  const LineFeatures picture = features(test::texturedPicture(5, SIZE));
  for (const LineEvidence& found : evidence(picture, Eigen::Matrix3d::Identity()))
  {
    EXPECT_GE(found.seen, 20U);
    EXPECT_GE(found.found, found.seen * 9 / 10);
    EXPECT_LT(found.chance(), 0.15);
  }
}

TEST(LineEvidence, IsNoMoreThanChanceWhereAHomographyIsWrong)
{
  const LineFeatures picture = features(test::texturedPicture(5, SIZE));
  Eigen::Matrix3d wrong = Eigen::Matrix3d::Identity();
  wrong(0, 2) = 57.0;
  wrong(1, 2) = -43.0;
  for (const LineEvidence& found : evidence(picture, wrong))
  {
    EXPECT_GE(found.seen, 20U);
    EXPECT_LT(static_cast<double>(found.found), 0.2 * static_cast<double>(found.seen));
  }
}

TEST(LineEvidence, OfParallelLinesSaysNothingAlongThem)
{
  const LineFeatures picture = features(posts());
  ASSERT_GE(picture.segments().size(), 20U);
  const auto found = evidence(picture, Eigen::Matrix3d::Identity());
  EXPECT_GE(found[0].found, 20U) << "along the rows";
  EXPECT_EQ(found[2].seen, 0U) << "along the columns, as the posts are";
}

TEST(LineEvidence, LeavesOutWhatOtherRegionsHave)
{
  const LineFeatures picture = features(test::texturedPicture(5, SIZE));
  const std::vector<char> all(picture.segments().size(), 1);
  for (const LineEvidence& found : evidence(picture, Eigen::Matrix3d::Identity(), all))
  {
    EXPECT_EQ(found.seen, 0U);
    EXPECT_EQ(found.chance(), 0.5) << "nothing is known";
  }
}

TEST(LineEvidence, OfSeveralRegionsIsAdded)
{
  LineEvidence sum{ 3, 2, 18, 1 };
  sum += LineEvidence{ 7, 5, 42, 4 };
  EXPECT_EQ(sum.seen, 10U);
  EXPECT_EQ(sum.found, 7U);
  EXPECT_EQ(sum.tried, 60U);
  EXPECT_EQ(sum.beside, 5U);
  EXPECT_DOUBLE_EQ(sum.chance(), 6.0 / 62.0);
}

}  // namespace view_servo
