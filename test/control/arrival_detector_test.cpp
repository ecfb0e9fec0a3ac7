// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/arrival_detector.h"

#include "support/textured_plane.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
double similarity(const cv::Mat& a, const cv::Mat& b)
{
  return gradientSimilarity(gradientMagnitude(a), gradientMagnitude(b));
}

/** As figure 5.5b of the thesis: flat and noisy far away, a steep rise, a peak, and a drop past it. */
struct Approach
{
  std::vector<double> values;
  std::size_t rise;  // index of the first value of the rise
  std::size_t peak;
};

Approach approach(std::uint64_t seed)
{
  Rng rng(seed);
  Approach result;
  for (int i = 0; i < 45; ++i)
  {
    result.values.push_back(0.10 + 0.012 * gaussian(rng));
  }
  result.rise = result.values.size();
  for (const double value : { 0.24, 0.38, 0.55, 0.66 })
  {
    result.values.push_back(value + 0.005 * gaussian(rng));
  }
  result.peak = result.values.size() - 1;
  for (const double value : { 0.50, 0.33, 0.20 })
  {
    result.values.push_back(value + 0.005 * gaussian(rng));
  }
  return result;
}

}  // namespace

// ---- the similarity

TEST(GradientMagnitude, IsThatOfARamp)
{
  cv::Mat ramp(40, 60, CV_8UC1);
  for (int v = 0; v < ramp.rows; ++v)
  {
    for (int u = 0; u < ramp.cols; ++u)
    {
      ramp.at<uchar>(v, u) = static_cast<uchar>(10 + 3 * u + 2 * v);
    }
  }
  const cv::Mat magnitude = gradientMagnitude(ramp);
  ASSERT_EQ(magnitude.type(), CV_32FC1);
  ASSERT_EQ(magnitude.size(), ramp.size());
  const cv::Mat inside = magnitude(cv::Rect(5, 5, 50, 30));
  EXPECT_LT(cv::norm(inside, cv::Mat(inside.size(), CV_32F, cv::Scalar(std::sqrt(13.0))), cv::NORM_INF), 1e-3);
}

TEST(GradientSimilarity, IsOneForTheSameImage)
{
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
  {
    const cv::Mat picture = test::texturedPicture(seed);
    EXPECT_NEAR(similarity(picture, picture), 1.0, 1e-6);
    // Pixels at random: nothing to do with each other.
    EXPECT_LT(std::abs(similarity(picture, test::texturedPicture(seed + 10))), 0.25);
  }
}

TEST(GradientSimilarity, DoesNotMindTheLight)
{
  const cv::Mat picture = test::texturedPicture(4);
  EXPECT_GT(similarity(picture, test::disturbed(picture, 0.5, 0.0, 0.0)), 0.99);
  EXPECT_GT(similarity(picture, test::disturbed(picture, 0.7, 40.0, 0.0)), 0.99);
  EXPECT_GT(similarity(picture, test::disturbed(picture, 0.7, 40.0, 3.0)), 0.9);
}

TEST(GradientSimilarity, FallsWithTheDisplacement)
{
  const cv::Mat picture = test::texturedPicture(5);
  double last = 1.0;
  for (const int shift : { 1, 2, 4 })
  {
    const cv::Rect here(0, 0, picture.cols - 8, picture.rows);
    const double now = similarity(picture(here), picture(here + cv::Point(shift, 0)));
    EXPECT_LT(now, last - 0.05) << shift;
    last = now;
  }
}

TEST(GradientSimilarity, IsNotANumberForBlankImages)
{
  const cv::Mat picture = test::texturedPicture(6);
  const cv::Mat blank(picture.size(), picture.type(), cv::Scalar(120));
  EXPECT_TRUE(std::isnan(similarity(picture, blank)));
  EXPECT_TRUE(std::isnan(similarity(blank, picture)));
  EXPECT_TRUE(std::isnan(similarity(blank, blank)));
  // The lens is covered: noise remains.
  EXPECT_TRUE(std::isnan(similarity(picture, test::disturbed(blank, 0.1, 0.0, 1.0))));
  EXPECT_TRUE(std::isnan(similarity(picture, test::disturbed(picture, 0.05, 0.0, 0.0))));
}

TEST(GradientSimilarity, RefusesAnotherSize)
{
  const cv::Mat picture = test::texturedPicture(7);
  const cv::Mat part = picture(cv::Rect(0, 0, picture.cols - 1, picture.rows));
  EXPECT_THROW(similarity(picture, part), std::invalid_argument);
}

// ---- the detector

TEST(ArrivalDetector, StopsAtTheDropAfterTheRise)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    const Approach run = approach(seed);
    ArrivalDetector detector{ ArrivalDetectorParams() };
    EXPECT_EQ(detector.state(), Arrival::APPROACHING);
    for (std::size_t i = 0; i < run.values.size(); ++i)
    {
      const Arrival state = detector.add(run.values[i]);
      const Arrival expected = i < run.rise ? Arrival::APPROACHING : i <= run.peak ? Arrival::NEAR : Arrival::REACHED;
      ASSERT_EQ(state, expected) << "seed " << seed << ", value " << i;
      ASSERT_EQ(detector.state(), state);
    }
  }
}

TEST(ArrivalDetector, IgnoresWhatIsNotANumber)
{
  const Approach run = approach(3);
  ArrivalDetector plain{ ArrivalDetectorParams() };
  ArrivalDetector interrupted{ ArrivalDetectorParams() };
  for (const double value : run.values)
  {
    const Arrival before = interrupted.state();
    EXPECT_EQ(interrupted.add(NOT_A_NUMBER), before);
    EXPECT_EQ(interrupted.add(std::numeric_limits<double>::infinity()), before);
    EXPECT_EQ(interrupted.add(value), plain.add(value));
  }
  EXPECT_EQ(plain.state(), Arrival::REACHED);
}

TEST(ArrivalDetector, FlatAndNoisyNeverArrives)
{
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    Rng rng(seed);
    ArrivalDetector detector{ ArrivalDetectorParams() };
    for (int i = 0; i < 300; ++i)
    {
      ASSERT_EQ(detector.add(0.15 + 0.012 * gaussian(rng)), Arrival::APPROACHING) << "seed " << seed << ", value " << i;
    }
  }
}

TEST(ArrivalDetector, SlowRiseIsNone)
{
  ArrivalDetectorParams params;
  ArrivalDetector detector(params);
  for (double value = 0.1; value < 0.9; value += 0.9 * params.min_rise)
  {
    EXPECT_EQ(detector.add(value), Arrival::APPROACHING);
  }
}

TEST(ArrivalDetector, RiseIsMeasuredByTheSpreadBefore)
{
  // The values before swing by 0.1 to both sides: their standard deviation is 0.1.
  const std::vector<double> restless{ 0.2, 0.4, 0.2, 0.4, 0.2, 0.4 };
  ArrivalDetectorParams params;
  params.rise = 3.0;
  for (const double rise : { 0.29, 0.31 })
  {
    ArrivalDetector detector(params);
    for (const double value : restless)
    {
      EXPECT_EQ(detector.add(value), Arrival::APPROACHING);
    }
    EXPECT_EQ(detector.add(0.4 + rise), rise < 0.3 ? Arrival::APPROACHING : Arrival::NEAR);
  }
  // However calm it was, the least rise is needed.
  for (const double rise : { 0.07, 0.09 })
  {
    ArrivalDetector detector(params);
    for (int i = 0; i < 6; ++i)
    {
      detector.add(0.2);
    }
    EXPECT_EQ(detector.add(0.2 + rise), rise < params.min_rise ? Arrival::APPROACHING : Arrival::NEAR);
  }
}

TEST(ArrivalDetector, NoRiseCountsBeforeThereIsAHistory)
{
  ArrivalDetectorParams params;
  params.min_history = 5;
  for (int before = 0; before < 8; ++before)
  {
    ArrivalDetector detector(params);
    for (int i = 0; i < before; ++i)
    {
      detector.add(0.1);
    }
    EXPECT_EQ(detector.add(0.6), before < 5 ? Arrival::APPROACHING : Arrival::NEAR) << before;
  }
}

TEST(ArrivalDetector, DropIsAPartOfTheGainSinceTheApproach)
{
  // From 0.1 to 0.6: 0.5 gained, of which a tenth is lost at 0.55.
  for (const double after : { 0.5525, 0.5475 })
  {
    ArrivalDetector detector{ ArrivalDetectorParams() };
    for (int i = 0; i < 5; ++i)
    {
      detector.add(0.1);
    }
    EXPECT_EQ(detector.add(0.6), Arrival::NEAR);
    EXPECT_EQ(detector.add(after), after > 0.55 ? Arrival::NEAR : Arrival::REACHED) << after;
  }
}

TEST(ArrivalDetector, StaysWhereItIsOnceReached)
{
  const Approach run = approach(1);
  ArrivalDetector detector{ ArrivalDetectorParams() };
  for (const double value : run.values)
  {
    detector.add(value);
  }
  for (const double value : { 0.9, 0.1, 0.9, NOT_A_NUMBER })
  {
    EXPECT_EQ(detector.add(value), Arrival::REACHED);
  }
}

TEST(ArrivalDetectorParams, NameAllFaultsAtOnce)
{
  EXPECT_TRUE(ArrivalDetectorParams().validate().empty());
  ArrivalDetectorParams params;
  params.rise = 0.0;
  params.min_rise = -1.0;
  params.drop = 1.0;
  params.min_history = 1;
  const std::vector<std::string> faults = params.validate();
  ASSERT_EQ(faults.size(), 4U);
  const std::vector<std::string> names{ "arrival_rise", "arrival_min_rise", "arrival_drop", "arrival_min_history" };
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    EXPECT_EQ(faults[i].find(names[i]), 0U) << faults[i];
  }
}

}  // namespace view_servo
