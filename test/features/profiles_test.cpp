// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/profiles.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <set>
#include <stdexcept>

namespace
{
using view_servo::Corner;
using view_servo::extractProfiles;
using view_servo::PairSelection;
using view_servo::profileFeatures;
using view_servo::ProfileParams;
using view_servo::ProfileSet;
using view_servo::reversalSign;
using view_servo::test::texturedPicture;

constexpr int COEFFICIENTS = 8;

/** A point of a 480x360 image, away from its border. */
Eigen::Vector2d anyPoint()
{
  return { *rc::gen::inRange(500, 47000) / 100.0, *rc::gen::inRange(500, 35000) / 100.0 };
}

RC_GTEST_PROP(Profiles, ReadBackwardsOnlyChangeSigns, ())
{
  static const cv::Mat picture = texturedPicture(1);
  const Eigen::Vector2d a = anyPoint();
  const Eigen::Vector2d b = anyPoint();
  RC_PRE((a - b).norm() > 10.0);
  float forward[COEFFICIENTS];
  float backward[COEFFICIENTS];
  RC_PRE(profileFeatures(picture, a, b, ProfileParams(), forward));
  RC_ASSERT(profileFeatures(picture, b, a, ProfileParams(), backward));
  for (int c = 0; c < COEFFICIENTS; ++c)
  {
    RC_ASSERT(std::abs(forward[c] - reversalSign(c) * backward[c]) < 2e-3F);
  }
}

RC_GTEST_PROP(Profiles, DoNotDependOnAnAffineChangeOfLight, ())
{
  // Even grey levels only, so that half of them plus an offset are whole numbers again.
  static const cv::Mat picture = texturedPicture(2) & 0xFE;
  cv::Mat darker;
  picture.convertTo(darker, CV_8U, 0.5, 30.0);
  const Eigen::Vector2d a = anyPoint();
  const Eigen::Vector2d b = anyPoint();
  RC_PRE((a - b).norm() > 10.0);
  ProfileParams params;
  params.min_contrast = 15.0;
  float bright[COEFFICIENTS];
  float dark[COEFFICIENTS];
  RC_PRE(profileFeatures(picture, a, b, params, bright));
  params.min_contrast = 1.0;
  RC_ASSERT(profileFeatures(darker, a, b, params, dark));
  for (int c = 0; c < COEFFICIENTS; ++c)
  {
    RC_ASSERT(std::abs(bright[c] - dark[c]) < 1e-3F);
  }
}

TEST(Profiles, KeepTheirFeaturesWhenTheImageIsEnlarged)
{
  // A smooth scene, so that the smaller image holds all that the larger one does.
  cv::Mat small;
  cv::GaussianBlur(texturedPicture(3), small, cv::Size(), 2.0);
  cv::Mat large;
  cv::resize(small, large, cv::Size(), 2.0, 2.0, cv::INTER_CUBIC);
  const auto enlarged = [](const Eigen::Vector2d& x) {
    return Eigen::Vector2d(2.0 * x.array() + 0.5);
  };
  cv::RNG rng(5);
  double worst = 0.0;
  int compared = 0;
  for (int i = 0; i < 300; ++i)
  {
    const Eigen::Vector2d a(rng.uniform(20.0, 460.0), rng.uniform(20.0, 340.0));
    const Eigen::Vector2d b(rng.uniform(20.0, 460.0), rng.uniform(20.0, 340.0));
    float one[COEFFICIENTS];
    float two[COEFFICIENTS];
    if ((a - b).norm() > 25.0 && (a - b).norm() < 150.0 && profileFeatures(small, a, b, ProfileParams(), one) &&
        profileFeatures(large, enlarged(a), enlarged(b), ProfileParams(), two))
    {
      ++compared;
      for (int c = 0; c < COEFFICIENTS; ++c)
      {
        worst = std::max(worst, static_cast<double>(std::abs(one[c] - two[c])));
      }
    }
  }
  ASSERT_GT(compared, 80);
  EXPECT_LT(worst, 0.05);  // raw features reach about 0.5
}

TEST(Profiles, AreTheCoefficientsOfEquation63)
{
  // Along the columns of this image intensity is 128 + 100 cos(2 pi (u - 10) / 80): its half-periods number two from
  // u = 10 to u = 90, so cos 2 takes it all.
  cv::Mat image(40, 120, CV_8UC1);
  for (int u = 0; u < image.cols; ++u)
  {
    image.col(u).setTo(std::lround(128.0 + 100.0 * std::cos(2.0 * M_PI * (u - 10) / 80.0)));
  }
  float features[COEFFICIENTS];
  ASSERT_TRUE(profileFeatures(image, { 10.0, 20.0 }, { 90.0, 20.0 }, ProfileParams(), features));
  // sin 1, cos 1, sin 2, cos 2, sin 3, ..: 1/N sum p(i) b(i) for p = cos(2 pi x), continuous limit.
  const double expected[COEFFICIENTS] = { -2.0 / (3.0 * M_PI), 0.0, 0.0, 0.5, 6.0 / (5.0 * M_PI), 0.0, 0.0, 0.0 };
  for (int c = 0; c < COEFFICIENTS; ++c)
  {
    EXPECT_NEAR(features[c], expected[c], 0.01) << "feature " << c;
  }
}

TEST(Profiles, WithoutContrastSayNothing)
{
  const cv::Mat flat(60, 60, CV_8UC1, cv::Scalar(77));
  float features[COEFFICIENTS] = { 5.0F };
  EXPECT_FALSE(profileFeatures(flat, { 10.0, 10.0 }, { 50.0, 50.0 }, ProfileParams(), features));
  EXPECT_EQ(features[0], 5.0F);
  EXPECT_FALSE(profileFeatures(texturedPicture(1), { -1.0, 10.0 }, { 50.0, 50.0 }, ProfileParams(), features));
  EXPECT_FALSE(profileFeatures(texturedPicture(1), { 10.0, 10.0 }, { 479.5, 50.0 }, ProfileParams(), features));
}

class ProfileSetsTest : public ::testing::Test
{
protected:
  cv::Mat picture_ = texturedPicture(4);
  std::vector<Corner> corners_ = view_servo::detectCorners(picture_, view_servo::CornerParams());
};

TEST_F(ProfileSetsTest, HoldEachPairOnceWithinTheLimits)
{
  ProfileParams params;
  params.neighbours = 20;
  const ProfileSet nearest = extractProfiles(picture_, corners_, params);
  params.selection = PairSelection::RADIUS;
  params.max_length = 60.0;
  const ProfileSet radius = extractProfiles(picture_, corners_, params);
  for (const ProfileSet* set : { &nearest, &radius })
  {
    ASSERT_GT(set->pairs.size(), 1000U);
    ASSERT_EQ(set->features.size(), set->pairs.size() * 8);
    std::set<std::pair<int, int>> seen;
    for (const ProfileSet::Pair& pair : set->pairs)
    {
      EXPECT_LT(pair.start, pair.end);
      EXPECT_TRUE(seen.emplace(pair.start, pair.end).second);
      EXPECT_GE((corners_[pair.start].position - corners_[pair.end].position).norm(), params.min_length);
    }
  }
  // Each corner starts at most 20 pairs: half of them may be shared at the least.
  EXPECT_LE(nearest.pairs.size(), corners_.size() * 20);
  std::size_t within = 0;
  for (std::size_t i = 0; i < corners_.size(); ++i)
  {
    for (std::size_t j = 0; j < i; ++j)
    {
      const double length = (corners_[i].position - corners_[j].position).norm();
      within += length >= params.min_length && length <= params.max_length ? 1 : 0;
    }
  }
  EXPECT_LE(radius.pairs.size(), within);
  EXPECT_GT(radius.pairs.size(), within * 9 / 10);  // all but those without contrast
}

TEST_F(ProfileSetsTest, PairEachCornerWithAllOfItsNearest)
{
  const cv::Mat noisy = view_servo::test::disturbed(picture_, 1.0, 0.0, 3.0);  // nothing is without contrast
  std::vector<Corner> corners = corners_;
  corners.resize(200);
  for (const int neighbours : { 1, 15, 100, 1000 })
  {
    ProfileParams params;
    params.neighbours = neighbours;
    params.min_contrast = 0.01;
    std::set<std::pair<int, int>> expected;
    for (int i = 0; i < 200; ++i)
    {
      std::vector<std::pair<double, int>> others;
      for (int j = 0; j < 200; ++j)
      {
        const double length = (corners[i].position - corners[j].position).norm();
        if (length >= params.min_length)
        {
          others.emplace_back(length, j);
        }
      }
      std::sort(others.begin(), others.end());
      others.resize(std::min<std::size_t>(others.size(), static_cast<std::size_t>(neighbours)));
      for (const auto& [length, j] : others)
      {
        expected.emplace(std::min(i, j), std::max(i, j));
      }
    }
    std::set<std::pair<int, int>> found;
    for (const ProfileSet::Pair& pair : extractProfiles(noisy, corners, params).pairs)
    {
      found.emplace(pair.start, pair.end);
    }
    EXPECT_EQ(found, expected) << neighbours << " neighbours";
  }
}

TEST_F(ProfileSetsTest, HaveUnitDeviationAndZeroMean)
{
  for (const int coefficients : { 4, 6, 8 })
  {
    ProfileParams params;
    params.coefficients = coefficients;
    const ProfileSet set = extractProfiles(picture_, corners_, params);
    ASSERT_EQ(set.coefficients, coefficients);
    for (int c = 0; c < coefficients; ++c)
    {
      double sum = 0.0;
      double squares = 0.0;
      for (std::size_t i = 0; i < set.pairs.size(); ++i)
      {
        const double value = static_cast<double>(set.feature(i)[c]);
        sum += value;
        squares += value * value;
      }
      const double count = static_cast<double>(set.pairs.size());
      EXPECT_NEAR(squares / count, 1.0, 1e-3);
      if (reversalSign(c) > 0.0F)  // over both directions the others have zero mean by themselves
      {
        EXPECT_NEAR(sum / count, 0.0, 1e-3);
      }
    }
  }
}

TEST(ReversalSign, FollowsTheSymmetryOfTheBasis)
{
  // sin 1 and cos 2 are even about the middle, cos 1 and sin 2 odd, and so on.
  const float expected[COEFFICIENTS] = { 1, -1, -1, 1, 1, -1, -1, 1 };
  for (int c = 0; c < COEFFICIENTS; ++c)
  {
    EXPECT_EQ(reversalSign(c), expected[c]);
  }
}

TEST(ProfileParams, NameEveryFault)
{
  EXPECT_TRUE(ProfileParams().validate().empty());
  ProfileParams params;
  params.neighbours = 0;
  params.min_length = 1.0;
  params.max_length = 0.5;
  params.coefficients = 5;
  params.min_contrast = 0.0;
  EXPECT_EQ(params.validate().size(), 5U);
}

TEST(Profiles, RefuseOtherImages)
{
  EXPECT_THROW(extractProfiles(cv::Mat(50, 50, CV_8UC3), {}, ProfileParams()), std::invalid_argument);
}

}  // namespace
