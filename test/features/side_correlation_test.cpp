// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/side_correlation.h"

#include "support/textured_plane.h"
#include "view_servo/robust/random.h"

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

/** AddressSanitizer sees whether a sample is read beside the image. */
TEST(SideCorrelation, ReadsNothingBesideTheImages)
{
  const cv::Mat image = test::texturedPicture(1, SIZE);
  Rng rng(1);
  for (int i = 0; i < 5000; ++i)
  {
    // Near the borders, by maps that leave them about where they are.
    const auto near_border = [&rng](int size) {
      return (uniform(rng, 0.0, 1.0) < 0.5 ? 0.0 : size - 1.0) + uniform(rng, -12.0, 12.0);
    };
    Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
    h.topRightCorner<2, 1>() << uniform(rng, -2.0, 2.0), uniform(rng, -2.0, 2.0);
    h.bottomLeftCorner<1, 2>() << uniform(rng, -2e-3, 2e-3), uniform(rng, -2e-3, 2e-3);
    const Segment segment{ { near_border(SIZE.width), near_border(SIZE.height) },
                           { near_border(SIZE.width), near_border(SIZE.height) } };
    const double found = sideCorrelation(image, image, h, segment, transferred(h, segment));
    EXPECT_GE(found, -1.0);
    EXPECT_LE(found, 1.0);
  }
}

}  // namespace view_servo
