// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/binary_features.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace
{
using view_servo::BinaryFeature;
using view_servo::BinaryFeatureParams;
using view_servo::detectBinaryFeatures;
using view_servo::hammingDistance;
using view_servo::test::texturedPicture;
using Features = std::vector<BinaryFeature>;

/** Share of the first features that have one in `others` which differs in few bits and is turned by `turn`. */
double shareIn(const Features& features, const Features& others, int turn)
{
  constexpr int SIMILAR = 48;        // [bits]
  constexpr int TURN_TOLERANCE = 8;  // [1/256 of a turn]
  const auto found = std::count_if(features.begin(), features.end(), [&](const BinaryFeature& feature) {
    return std::any_of(others.begin(), others.end(), [&](const BinaryFeature& other) {
      const auto error = static_cast<std::int8_t>(other.angle - feature.angle - turn);
      return hammingDistance(feature.word, other.word) <= SIMILAR && std::abs(error) <= TURN_TOLERANCE;
    });
  });
  return static_cast<double>(found) / static_cast<double>(features.size());
}

Features detect(const cv::Mat& image, const cv::Rect& region = cv::Rect())
{
  return detectBinaryFeatures(image, region, BinaryFeatureParams());
}

TEST(BinaryFeatures, AreTheSameForTheSameImage)
{
  const cv::Mat image = texturedPicture(1, cv::Size(640, 480));
  const Features first = detect(image);
  const Features second = detect(image);
  ASSERT_GT(first.size(), 300U);
  ASSERT_LE(first.size(), 500U);
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i)
  {
    EXPECT_EQ(first[i].word, second[i].word);
    EXPECT_EQ(first[i].angle, second[i].angle);
  }
}

TEST(BinaryFeatures, AreNoMoreThanAskedForWhereAllAreAlike)
{
  cv::Mat image(480, 480, CV_8UC1, cv::Scalar(60));
  constexpr int PERIOD = 16;
  for (int v = 0; v + PERIOD <= image.rows; v += PERIOD)
  {
    for (int u = 0; u + PERIOD <= image.cols; u += PERIOD)
    {
      image(cv::Rect(u + 4, v + 4, PERIOD / 2, PERIOD / 2)) = 200;
    }
  }
  const Features features = detect(image);
  EXPECT_EQ(features.size(), static_cast<std::size_t>(BinaryFeatureParams().max_features));
}

TEST(BinaryFeatures, StayInOtherLightAndSizeAndTurnWithTheImage)
{
  const cv::Mat image = texturedPicture(1, cv::Size(640, 480));
  const Features features = detect(image);
  EXPECT_LT(shareIn(features, detect(texturedPicture(2, cv::Size(640, 480))), 0), 0.1);
  cv::Mat dark;
  image.convertTo(dark, CV_8U, 0.6);
  EXPECT_GT(shareIn(features, detect(dark), 0), 0.8);
  cv::Mat half;
  cv::resize(image, half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  EXPECT_GT(shareIn(features, detect(half), 0), 0.4);
  cv::Mat turned;
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  EXPECT_GT(shareIn(features, detect(turned), 64), 0.7);
}

TEST(BinaryFeatures, AreOfTheRegionOnly)
{
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(128));
  texturedPicture(1, cv::Size(240, 240)).copyTo(image(cv::Rect(0, 0, 240, 240)));
  EXPECT_GT(detect(image).size(), 100U);
  EXPECT_TRUE(detect(image, cv::Rect(300, 0, 340, 480)).empty());
}

TEST(BinaryFeatures, OfAnImageWithoutCornersThereAreNone)
{
  EXPECT_TRUE(detect(cv::Mat(480, 640, CV_8UC1, cv::Scalar(0))).empty());
  EXPECT_TRUE(detect(cv::Mat(1, 1, CV_8UC1, cv::Scalar(0))).empty());
  EXPECT_TRUE(detect(cv::Mat(3, 2000, CV_8UC1, cv::Scalar(9))).empty());
}

TEST(BinaryFeatures, RefuseOtherImages)
{
  EXPECT_THROW(detect(cv::Mat()), std::invalid_argument);
  EXPECT_THROW(detect(cv::Mat(100, 100, CV_8UC3)), std::invalid_argument);
  EXPECT_THROW(detect(cv::Mat(100, 100, CV_8UC1), cv::Rect(50, 50, 51, 10)), std::invalid_argument);
}

}  // namespace
