// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/patch.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <cmath>
#include <optional>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int RADIUS = 10;

Eigen::Matrix3d translation(double u, double v)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h.topRightCorner<2, 1>() << u, v;
  return h;
}

}  // namespace

TEST(Patch, NormalizedValuesHaveNoMeanAndUnitNorm)
{
  std::vector<float> values{ 10.0F, 40.0F, 70.0F, 200.0F };
  EXPECT_NEAR(normalize(values), std::sqrt(70.0 * 70.0 + 40.0 * 40.0 + 10.0 * 10.0 + 120.0 * 120.0), 1e-3);
  float sum = 0.0F;
  float squares = 0.0F;
  for (const float value : values)
  {
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum, 0.0F, 1e-6F);
  EXPECT_NEAR(squares, 1.0F, 1e-6F);
  std::vector<float> flat(9, 50.0F);
  EXPECT_EQ(normalize(flat), 0.0F);
  EXPECT_EQ(flat, std::vector<float>(9, 50.0F));
}

TEST(Patch, NeedsContrastInTwoDirectionsAndRoom)
{
  const cv::Mat picture = test::texturedPicture(1);
  EXPECT_TRUE(makePatch(picture, { 200.0, 150.0 }, RADIUS).usable);
  EXPECT_FALSE(makePatch(picture, { 11.0, 150.0 }, RADIUS).usable);
  EXPECT_FALSE(makePatch(picture, { 200.0, 349.0 }, RADIUS).usable);
  EXPECT_FALSE(makePatch(cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)), { 200.0, 150.0 }, RADIUS).usable);
  cv::Mat edge(360, 480, CV_8UC1, cv::Scalar(50));
  edge(cv::Rect(0, 0, 200, 360)).setTo(150);
  EXPECT_FALSE(makePatch(edge, { 200.0, 150.0 }, RADIUS).usable);
}

TEST(Patch, IsFoundWhereTheHomographyDoesNotQuitePutIt)
{
  const cv::Mat picture = test::texturedPicture(1);
  const cv::Mat current =
      test::disturbed(test::warpedPicture(picture, translation(7.3, -4.6), picture.size()), 0.8, 20.0, 0.0);
  const Eigen::Vector2d at(200.0, 150.0);
  const std::optional<PatchAlignment> found =
      align(makePatch(picture, at, RADIUS), at, current, translation(6.0, -4.0), 20);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((found->found - Eigen::Vector2d(207.3, 145.4)).norm(), 0.1);
  // What the homography shows at `at`, the current image's place (206, 146), is the stored view at (198.7, 150.6).
  EXPECT_LT((found->shift - Eigen::Vector2d(-1.3, 0.6)).norm(), 0.1);
  EXPECT_GT(found->correlation, 0.95);
}

TEST(Patch, IsNotFoundOutsideTheImage)
{
  const cv::Mat picture = test::texturedPicture(1);
  const Eigen::Vector2d at(200.0, 150.0);
  const Patch patch = makePatch(picture, at, RADIUS);
  EXPECT_FALSE(align(patch, at, picture, translation(272.0, 0.0), 20).has_value());
  EXPECT_FALSE(align(patch, at, cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)), translation(0.0, 0.0), 20).has_value());
}

}  // namespace view_servo
