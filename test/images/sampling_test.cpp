// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/sampling.h"

#include "support/random_picture.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace view_servo
{
TEST(BilinearSampler, GivesPixelsAsTheyAre)
{
  const cv::Mat image = test::randomPicture(1, cv::Size(9, 7));
  const BilinearSampler sampler(image);
  for (int v = 0; v < image.rows - 1; ++v)
  {
    for (int u = 0; u < image.cols - 1; ++u)
    {
      EXPECT_EQ(sampler.at(static_cast<float>(u), static_cast<float>(v)), image.at<unsigned char>(v, u));
    }
  }
}

TEST(BilinearSampler, InterpolatesBetweenFourPixels)
{
  const cv::Mat image = (cv::Mat_<unsigned char>(2, 2) << 10, 30, 50, 255);
  const BilinearSampler sampler(image);
  EXPECT_FLOAT_EQ(sampler.at(0.25F, 0.0F), 15.0F);
  EXPECT_FLOAT_EQ(sampler.at(0.0F, 0.75F), 40.0F);
  EXPECT_FLOAT_EQ(sampler.at(0.5F, 0.5F), (10.0F + 30.0F + 50.0F + 255.0F) / 4.0F);
  // A difference may be negative.
  const cv::Mat falling = (cv::Mat_<unsigned char>(2, 2) << 255, 0, 255, 0);
  EXPECT_FLOAT_EQ(BilinearSampler(falling).at(0.2F, 0.5F), 204.0F);
}

TEST(BilinearSampler, ReadsAlongALineWhatItReadsAtEachPlace)
{
  const cv::Mat image = test::randomPicture(1, cv::Size(60, 40));
  const BilinearSampler sampler(image(cv::Rect(3, 2, 50, 30)));
  const Eigen::Vector2f first(2.3F, 25.8F);
  const Eigen::Vector2f step(0.7F, -0.41F);
  for (const int count : { 0, 1, 4, 7, 48 })
  {
    std::vector<float> values(static_cast<std::size_t>(count) + 1, -1.0F);
    sampler.alongLine(first, step, count, values.data());
    for (int i = 0; i < count; ++i)
    {
      const Eigen::Vector2f place = first + static_cast<float>(i) * step;
      EXPECT_NEAR(values[static_cast<std::size_t>(i)], sampler.at(place.x(), place.y()), 0.01F) << i << " of " << count;
    }
    EXPECT_EQ(values.back(), -1.0F);
  }
}

TEST(BilinearSampler, ReadsPartsOfImages)
{
  const cv::Mat image = test::randomPicture(1, cv::Size(30, 20));
  const cv::Mat part = image(cv::Rect(5, 3, 10, 8));
  EXPECT_EQ(BilinearSampler(part).at(2.5F, 4.25F), BilinearSampler(image).at(7.5F, 7.25F));
}

TEST(BilinearSampler, ContainsAllButTheLastColumnAndRow)
{
  const BilinearSampler sampler(cv::Mat(40, 60, CV_8UC1));
  EXPECT_TRUE(sampler.contains(0.0F, 0.0F));
  EXPECT_TRUE(sampler.contains(58.99F, 38.99F));
  EXPECT_FALSE(sampler.contains(59.0F, 10.0F));
  EXPECT_FALSE(sampler.contains(10.0F, 39.0F));
  EXPECT_FALSE(sampler.contains(-0.01F, 10.0F));
  EXPECT_FALSE(sampler.contains(10.0F, -0.01F));
  EXPECT_FALSE(sampler.contains(std::numeric_limits<float>::quiet_NaN(), 10.0F));
  EXPECT_FALSE(sampler.contains(10.0, std::numeric_limits<double>::quiet_NaN()));
  // Which becomes the border itself in single precision.
  const double close = std::nextafter(59.0, 0.0);
  EXPECT_TRUE(sampler.contains(close, 10.0));
  EXPECT_FALSE(sampler.contains(static_cast<float>(close), 10.0F));
  EXPECT_FALSE(BilinearSampler(cv::Mat()).contains(0.0F, 0.0F));
}

}  // namespace view_servo
