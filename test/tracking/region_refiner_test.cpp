// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/region_refiner.h"

#include "support/corner_error.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace view_servo
{
namespace
{
const cv::Size REGION_SIZE(480, 360);
const cv::Rect REGION(60, 40, 360, 280);
constexpr double MIN_CORRELATION = 0.7;

/** As a homography that is off by about a pixel. */
Eigen::Matrix3d nearly(const Eigen::Matrix3d& h)
{
  Eigen::Matrix3d off = Eigen::Matrix3d::Identity();
  off.topRightCorner<2, 1>() << 0.8, -0.6;
  off(0, 1) = 1e-3;
  return off * h;
}

}  // namespace

TEST(RegionRefiner, CorrectsAHomographyThatIsOffByAPixel)
{
  const cv::Mat reference = test::texturedPicture(1, REGION_SIZE);
  const Eigen::Matrix3d truth = test::exampleHomography();
  const cv::Mat current = test::warpedPicture(reference, truth, REGION_SIZE);
  const RegionRefiner refiner(reference, REGION, MIN_CORRELATION);
  EXPECT_GT(refiner.size(), 100U);
  EXPECT_LE(refiner.size(), 17U * 13U);
  const Eigen::Matrix3d refined = refiner.refine(current, nearly(truth));
  EXPECT_GT(test::cornerError(nearly(truth), truth, REGION_SIZE), 0.9);
  EXPECT_LT(test::cornerError(refined, truth, REGION_SIZE), 0.1);
}

TEST(RegionRefiner, IsNotMisledByLightAndWhatCoversAPart)
{
  const cv::Mat reference = test::texturedPicture(1, REGION_SIZE);
  const Eigen::Matrix3d truth = test::exampleHomography();
  cv::Mat current = test::disturbed(test::warpedPicture(reference, truth, REGION_SIZE), 0.7, 20.0, 2.0);
  const cv::Rect part(150, 0, 120, 360);
  test::texturedPicture(2, REGION_SIZE)(part).copyTo(current(part));
  const Eigen::Matrix3d refined = RegionRefiner(reference, REGION, MIN_CORRELATION).refine(current, nearly(truth));
  EXPECT_LT(test::cornerError(refined, truth, REGION_SIZE), 0.3);
}

TEST(RegionRefiner, LeavesAHomographyAsItIsWhereTheRegionIsNotSeen)
{
  const cv::Mat reference = test::texturedPicture(1, REGION_SIZE);
  const RegionRefiner refiner(reference, REGION, MIN_CORRELATION);
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  EXPECT_EQ(refiner.refine(test::texturedPicture(2, REGION_SIZE), identity), identity);
  EXPECT_EQ(refiner.refine(cv::Mat(REGION_SIZE, CV_8UC1, cv::Scalar(90)), identity), identity);
  Eigen::Matrix3d away = identity;
  away(0, 2) = 1000.0;
  EXPECT_EQ(refiner.refine(reference, away), away);
}

TEST(RegionRefiner, FlatBlocksAreLeftOut)
{
  cv::Mat reference(REGION_SIZE, CV_8UC1, cv::Scalar(90));
  EXPECT_EQ(RegionRefiner(reference, REGION, MIN_CORRELATION).size(), 0U);
  const RegionRefiner none(reference, cv::Rect(10, 10, 20, 20), MIN_CORRELATION);  // less than a block
  EXPECT_EQ(none.refine(reference, Eigen::Matrix3d::Identity()), Eigen::Matrix3d::Identity());
}

}  // namespace view_servo
