// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/prepared_image.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <vector>

namespace
{
using view_servo::Corner;
using view_servo::LineFeatureParams;
using view_servo::LineFeatures;
using view_servo::LineSegmentParams;
using view_servo::PointMatcherParams;
using view_servo::PreparedImage;
using view_servo::Segment;
using view_servo::test::texturedPicture;

TEST(PreparedImage, LevelsShrinkByTheRootOfTwoAndMapBack)
{
  const PreparedImage image(texturedPicture(1), cv::Rect(), PointMatcherParams());
  EXPECT_EQ(image.image(0).size(), cv::Size(480, 360));
  EXPECT_EQ(image.image(1).size(), cv::Size(339, 255));
  EXPECT_EQ(image.image(2).size(), cv::Size(240, 180));
  EXPECT_EQ(image.toFull(0), Eigen::Matrix3d::Identity());
  // The outer edges of the first and the last pixel stay where they are.
  for (int level = 0; level < PreparedImage::SCALES; ++level)
  {
    const cv::Size size = image.image(level).size();
    const Eigen::Vector3d first = image.toFull(level) * Eigen::Vector3d(-0.5, -0.5, 1.0);
    const Eigen::Vector3d last = image.toFull(level) * Eigen::Vector3d(size.width - 0.5, size.height - 0.5, 1.0);
    EXPECT_NEAR((first.hnormalized() - Eigen::Vector2d(-0.5, -0.5)).norm(), 0.0, 1e-9);
    EXPECT_NEAR((last.hnormalized() - Eigen::Vector2d(479.5, 359.5)).norm(), 0.0, 1e-9);
  }
}

TEST(PreparedImage, ShowsTheSamePlacesFromTheSides)
{
  const PreparedImage image(texturedPicture(1), cv::Rect(), PointMatcherParams());
  for (int side = 0; side < PreparedImage::SIDES; ++side)
  {
    SCOPED_TRACE(side);
    const int level = PreparedImage::SCALES + side;
    const Eigen::Matrix3d to_full = image.toFull(level);
    EXPECT_EQ(to_full.row(2), Eigen::RowVector3d(0.0, 0.0, 1.0));
    EXPECT_NEAR(to_full.topLeftCorner(2, 2).determinant(), PreparedImage::TILT, 0.1);

    // Blurred along the direction in which it is compressed, the full image has nearly the same grey values.
    const Eigen::Vector2d along = to_full.topLeftCorner(2, 2).col(0);
    double difference = 0.0;
    int count = 0;
    for (const Corner& corner : image.points(level).corners)
    {
      const Eigen::Vector2d centre = (to_full * corner.position.homogeneous()).hnormalized();
      EXPECT_GT(centre.x(), 0.0);
      EXPECT_GT(centre.y(), 0.0);
      EXPECT_LT(centre.x(), 479.0);
      EXPECT_LT(centre.y(), 359.0);
      const cv::Point at(static_cast<int>(std::lround(corner.position.x())),
                         static_cast<int>(std::lround(corner.position.y())));
      const Eigen::Vector2d exact = (to_full * Eigen::Vector3d(at.x, at.y, 1.0)).hnormalized();
      double sum = 0.0;
      constexpr int SAMPLES = 11;
      for (int i = 0; i < SAMPLES; ++i)
      {
        const Eigen::Vector2d place = exact + ((i + 0.5) / SAMPLES - 0.5) * along;
        const cv::Point pixel(static_cast<int>(std::lround(place.x())), static_cast<int>(std::lround(place.y())));
        sum += image.grey().at<unsigned char>(std::clamp(pixel.y, 0, 359), std::clamp(pixel.x, 0, 479));
      }
      difference += std::abs(sum / SAMPLES - image.image(level).at<unsigned char>(at));
      ++count;
    }
    ASSERT_GT(count, 50);
    EXPECT_LT(difference / count, 8.0);
  }
}

TEST(PreparedImage, LeavesOutSidesOfSmallImages)
{
  const PreparedImage image(texturedPicture(1), cv::Rect(10, 10, 100, 80), PointMatcherParams());
  EXPECT_TRUE(image.image(PreparedImage::SCALES).empty());
  EXPECT_TRUE(image.points(PreparedImage::SCALES).corners.empty());
}

TEST(PreparedImage, ComputesItsFeaturesOnceForAllThreads)
{
  const PreparedImage image(texturedPicture(2), cv::Rect(), PointMatcherParams());
  std::vector<std::thread> threads;
  std::vector<const void*> seen(4);
  for (std::size_t i = 0; i < seen.size(); ++i)
  {
    threads.emplace_back([&, i] { seen[i] = &image.profileIndex(0); });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  for (const void* address : seen)
  {
    EXPECT_EQ(address, seen[0]);
  }
  EXPECT_EQ(&image.points(0), &image.points(0));
  EXPECT_GT(image.points(0).corners.size(), 100U);
}

TEST(PreparedImage, LooksForFeaturesInItsRegionOnEveryLevel)
{
  const cv::Rect region(100, 60, 220, 200);
  const PreparedImage image(texturedPicture(3), region, PointMatcherParams());
  EXPECT_EQ(image.region(), region);
  for (const int level : { 0, 1, 2, PreparedImage::SCALES, PreparedImage::SCALES + 3 })
  {
    ASSERT_GT(image.points(level).corners.size(), level < PreparedImage::SCALES ? 20U : 5U);
    for (const Corner& corner : image.points(level).corners)
    {
      const Eigen::Vector2d full = (image.toFull(level) * corner.position.homogeneous()).hnormalized();
      EXPECT_GE(full.x(), region.x - 3.0);
      EXPECT_GE(full.y(), region.y - 3.0);
      EXPECT_LE(full.x(), region.x + region.width + 3.0);
      EXPECT_LE(full.y(), region.y + region.height + 3.0);
    }
  }
}

TEST(PreparedImage, DetectsLinesInItsRegionOnceForAllThreads)
{
  const cv::Rect region(100, 60, 220, 200);
  LineSegmentParams segments;
  segments.min_length = 20.0;
  LineFeatureParams lines;
  lines.max_grouped = 5;
  const PreparedImage image(texturedPicture(3), region, { segments, lines });
  std::vector<std::thread> threads;
  std::vector<const LineFeatures*> seen(4);
  for (const LineFeatures*& address : seen)
  {
    threads.emplace_back([&] { address = &image.lines(); });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), &image.lines()), 4);

  EXPECT_EQ(image.lines().groupedCount(), 5);
  ASSERT_GT(image.lines().segments().size(), 10U);
  for (const Segment& segment : image.lines().segments())
  {
    EXPECT_GE(segment.length(), 20.0);
    for (const Eigen::Vector2d& end : { segment.start, segment.end })
    {
      EXPECT_GE(end.x(), region.x - 1.0);
      EXPECT_GE(end.y(), region.y - 1.0);
      EXPECT_LE(end.x(), region.x + region.width);
      EXPECT_LE(end.y(), region.y + region.height);
    }
  }
}

TEST(PreparedImage, HasNoFeaturesOnLevelsThatAreTooSmall)
{
  const PreparedImage image(texturedPicture(4, cv::Size(100, 90)), cv::Rect(), PointMatcherParams());
  EXPECT_FALSE(image.image(0).empty());
  EXPECT_TRUE(image.image(4).empty());
  EXPECT_TRUE(image.points(4).corners.empty());
  EXPECT_EQ(image.profileIndex(4).search(image.points(0).profiles, {}).size(), image.points(0).profiles.pairs.size());
}

TEST(PreparedImage, WithoutARegionTakesAll)
{
  const PreparedImage image(texturedPicture(1), cv::Rect(), PointMatcherParams());
  EXPECT_EQ(image.region(), cv::Rect(0, 0, 480, 360));
}

TEST(PreparedImage, RefusesWhatItCannotUse)
{
  EXPECT_THROW(PreparedImage(cv::Mat(), cv::Rect(), PointMatcherParams()), std::invalid_argument);
  EXPECT_THROW(PreparedImage(cv::Mat(90, 90, CV_8UC3), cv::Rect(), PointMatcherParams()), std::invalid_argument);
  EXPECT_THROW(PreparedImage(texturedPicture(1), cv::Rect(400, 0, 100, 50), PointMatcherParams()),
               std::invalid_argument);
  const PreparedImage image(texturedPicture(1), cv::Rect(), PointMatcherParams());
  EXPECT_THROW(image.points(PreparedImage::LEVELS), std::out_of_range);
  EXPECT_THROW(image.points(-1), std::out_of_range);
}

}  // namespace
