// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/side_correlation.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

namespace view_servo
{
namespace
{
const cv::Size SIZE(480, 360);

Eigen::Vector2d transferred(const Eigen::Matrix3d& h, const Eigen::Vector2d& x)
{
  return (h * x.homogeneous()).hnormalized();
}

Segment transferred(const Eigen::Matrix3d& h, const Segment& segment)
{
  return { transferred(h, segment.start), transferred(h, segment.end) };
}

}  // namespace

TEST(SideCorrelation, IsHighForTheSamePlaceUnderAnotherLight)
{
  const cv::Mat reference = test::texturedPicture(1, SIZE);
  const Eigen::Matrix3d h = test::exampleHomography();
  const cv::Mat current = test::disturbed(test::warpedPicture(reference, h, SIZE), 0.7, 30.0, 2.0);
  const Segment segment{ { 120.0, 90.0 }, { 220.0, 170.0 } };
  EXPECT_GT(sideCorrelation(reference, current, h, segment, transferred(h, segment)), 0.9);
  // Only what both segments show is compared.
  const Segment whole = transferred(h, segment);
  EXPECT_GT(sideCorrelation(reference, current, h, segment, { whole.midpoint(), whole.end }), 0.9);
}

TEST(SideCorrelation, IsLowForAnotherPlace)
{
  const cv::Mat reference = test::texturedPicture(1, SIZE);
  const cv::Mat current = test::texturedPicture(2, SIZE);
  const Segment segment{ { 120.0, 90.0 }, { 220.0, 170.0 } };
  EXPECT_LT(sideCorrelation(reference, current, Eigen::Matrix3d::Identity(), segment, segment), 0.6);
}

TEST(SideCorrelation, OneSideIsEnough)
{
  const cv::Mat reference = test::texturedPicture(1, SIZE);
  cv::Mat current = reference.clone();
  const cv::Rect below(0, 180, 480, 180);
  test::texturedPicture(2, SIZE)(below).copyTo(current(below));
  const Segment segment{ { 120.0, 179.0 }, { 260.0, 179.0 } };
  EXPECT_GT(sideCorrelation(reference, current, Eigen::Matrix3d::Identity(), segment, segment), 0.95);
}

TEST(SideCorrelation, KnowsNothingWhereThereIsNothingToSee)
{
  const cv::Mat flat(SIZE, CV_8UC1, cv::Scalar(90));
  const Segment segment{ { 120.0, 90.0 }, { 220.0, 170.0 } };
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  EXPECT_NEAR(sideCorrelation(flat, flat, identity, segment, segment), 0.0, 1e-3);
  // Beyond infinity.
  EXPECT_EQ(sideCorrelation(flat, flat, -identity, segment, segment), 0.0);
  // Out of the current image.
  Eigen::Matrix3d away = identity;
  away(0, 2) = 1000.0;
  EXPECT_EQ(sideCorrelation(flat, flat, away, segment, transferred(away, segment)), -1.0);
}

}  // namespace view_servo
