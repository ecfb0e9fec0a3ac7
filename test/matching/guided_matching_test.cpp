// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/guided_matching.h"

#include "support/synthetic_scene.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <cmath>
#include <vector>

namespace
{
using view_servo::Association;
using view_servo::AssociationMatrix;
using view_servo::Corner;
using view_servo::GuidedMatch;
using view_servo::GuidedParams;
using view_servo::searchAlongHomography;
using view_servo::test::exampleHomography;
using view_servo::test::texturedPicture;

class SearchAlongHomographyTest : public ::testing::Test
{
protected:
  /** Distances of the matches from the truth [px]. */
  std::vector<double> errors(const std::vector<GuidedMatch>& matches) const
  {
    std::vector<double> result;
    for (const GuidedMatch& match : matches)
    {
      const Corner& corner = corners_[static_cast<std::size_t>(match.reference)];
      result.push_back(((truth_ * corner.position.homogeneous()).hnormalized() - match.current).norm());
    }
    return result;
  }

  Eigen::Matrix3d truth_ = exampleHomography();
  cv::Mat reference_ = texturedPicture(1);
  cv::Mat current_ = view_servo::test::disturbed(
      view_servo::test::warpedPicture(reference_, truth_, cv::Size(480, 360)), 0.7, 25.0, 2.0);
  std::vector<Corner> corners_ = view_servo::detectCorners(reference_, view_servo::CornerParams());
};

TEST_F(SearchAlongHomographyTest, FindsCornersToAFractionOfAPixel)
{
  const std::vector<GuidedMatch> matches =
      searchAlongHomography(reference_, corners_, current_, truth_, 3.0, GuidedParams());
  ASSERT_GT(matches.size(), corners_.size() / 2);
  std::vector<double> found = errors(matches);
  std::sort(found.begin(), found.end());
  EXPECT_LT(found[found.size() / 2], 0.15);
  EXPECT_LT(found[found.size() * 9 / 10], 0.6);
  for (const GuidedMatch& match : matches)
  {
    EXPECT_GE(match.correlation, GuidedParams().min_correlation);
    EXPECT_LE(match.correlation, 1.0);
  }
}

TEST_F(SearchAlongHomographyTest, FindsAPatchWhereItIsItself)
{
  std::vector<Corner> corners = corners_;
  for (Corner& corner : corners)
  {
    corner.position = corner.position.array().round();
  }
  for (const int radius : { 3, 7, 20 })
  {
    GuidedParams params;
    params.patch_radius = radius;
    const std::vector<GuidedMatch> matches =
        searchAlongHomography(reference_, corners, reference_, Eigen::Matrix3d::Identity(), 3.0, params);
    ASSERT_GT(matches.size(), corners.size() / 3) << radius;
    for (const GuidedMatch& match : matches)
    {
      EXPECT_GT(match.correlation, 0.9995) << radius;
      EXPECT_LT((match.current - corners[static_cast<std::size_t>(match.reference)].position).norm(), 0.3) << radius;
    }
  }
}

TEST_F(SearchAlongHomographyTest, CorrectsAPredictionThatIsOff)
{
  Eigen::Matrix3d off = Eigen::Matrix3d::Identity();
  off(0, 2) = 2.4;
  off(1, 2) = -1.7;
  const std::vector<GuidedMatch> matches =
      searchAlongHomography(reference_, corners_, current_, off * truth_, 5.0, GuidedParams());
  ASSERT_GT(matches.size(), corners_.size() / 2);
  std::vector<double> found = errors(matches);
  std::sort(found.begin(), found.end());
  EXPECT_LT(found[found.size() / 2], 0.2);
}

TEST_F(SearchAlongHomographyTest, FindsLittleAlongAWrongOne)
{
  Eigen::Matrix3d wrong = truth_;
  wrong(0, 2) += 60.0;
  const std::size_t found = searchAlongHomography(reference_, corners_, current_, wrong, 3.0, GuidedParams()).size();
  EXPECT_LT(found, corners_.size() / 20);
}

TEST_F(SearchAlongHomographyTest, SurvivesHomographiesThatAreNone)
{
  EXPECT_TRUE(
      searchAlongHomography(reference_, corners_, current_, Eigen::Matrix3d::Zero(), 3.0, GuidedParams()).empty());
  Eigen::Matrix3d flat = Eigen::Matrix3d::Identity();
  flat.row(1) = flat.row(0);
  EXPECT_TRUE(searchAlongHomography(reference_, corners_, current_, flat, 3.0, GuidedParams()).empty());
  const Eigen::Matrix3d nan = Eigen::Matrix3d::Constant(std::nan(""));
  EXPECT_TRUE(searchAlongHomography(reference_, corners_, current_, nan, 3.0, GuidedParams()).empty());
  EXPECT_TRUE(searchAlongHomography(reference_, corners_, cv::Mat(20, 20, CV_8UC1, cv::Scalar(9)),
                                    Eigen::Matrix3d::Identity(), 3.0, GuidedParams())
                  .empty());
}

TEST(AssociateAlongFundamental, KeepsWhatLiesOnItsEpipolarLine)
{
  // Pure translation along the rows: corresponding points share their row.
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
  f(1, 2) = -1.0;
  f(2, 1) = 1.0;
  const std::vector<Corner> reference = { { { 10.0, 50.0 }, 1.0F }, { { 20.0, 80.0 }, 1.0F } };
  const std::vector<Corner> current = { { { 60.0, 50.5 }, 1.0F }, { { 60.0, 83.0 }, 1.0F }, { { 5.0, 50.0 }, 1.0F } };
  const AssociationMatrix before(2, 3, { { 0, 0, 4.0 }, { 0, 2, 1.0 }, { 1, 1, 8.0 }, { 1, 0, 2.0 } });
  const AssociationMatrix along = associateAlongFundamental(before, reference, current, f, 1.0);
  ASSERT_EQ(along.entries().size(), 2U);
  // Fit plus the former weight as a part of the largest; the Sampson distance is the row's difference over sqrt(2).
  EXPECT_NEAR(along.weight(0, 0), 1.0 - 0.5 / std::sqrt(2.0) + 0.5, 1e-9);
  EXPECT_NEAR(along.weight(0, 2), 1.0 + 0.125, 1e-9);
  EXPECT_EQ(along.weight(1, 1), 0.0);
}

TEST(GuidedParams, NameEveryFault)
{
  EXPECT_TRUE(GuidedParams().validate().empty());
  GuidedParams params;
  params.patch_radius = 0;
  params.min_correlation = 1.0;
  EXPECT_EQ(params.validate().size(), 2U);
}

}  // namespace
