// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/edges.h"

#include "support/drawn_picture.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

namespace
{
using view_servo::detectEdges;
using view_servo::EdgeChain;
using view_servo::EdgeParams;
using view_servo::test::disturbed;
using view_servo::test::drawnPicture;
using view_servo::test::texturedPicture;

/**
 * Brighter by `contrast` on one side of the line through (40.3, 39.8) than on the other; `angle` of the line's normal.
 */
cv::Mat straightEdge(double angle, double contrast)
{
  const Eigen::Vector2d normal(std::cos(angle), std::sin(angle));
  return drawnPicture(cv::Size(80, 80), [&](const Eigen::Vector2d& point) {
    return normal.dot(point - Eigen::Vector2d(40.3, 39.8)) > 0.0 ? 60.0 + contrast : 60.0;
  });
}

/** A bright disc of radius 30 px at (50.2, 49.6). */
cv::Mat disc()
{
  return drawnPicture(cv::Size(100, 100), [](const Eigen::Vector2d& point) {
    return (point - Eigen::Vector2d(50.2, 49.6)).norm() < 30.0 ? 190.0 : 50.0;
  });
}

std::size_t pointsOf(const std::vector<EdgeChain>& edges)
{
  std::size_t count = 0;
  for (const EdgeChain& edge : edges)
  {
    count += edge.size();
  }
  return count;
}

TEST(Edges, LieOnAStraightEdgeToATenthOfAPixel)
{
  for (int i = 0; i < 24; ++i)
  {
    const double angle = 0.01 + i * M_PI / 12.0;
    const Eigen::Vector2d normal(std::cos(angle), std::sin(angle));
    for (const double sigma : { 0.7, 1.0, 2.0 })
    {
      EdgeParams params;
      params.sigma = sigma;
      const std::vector<EdgeChain> edges = detectEdges(straightEdge(angle, 120.0), params);
      ASSERT_EQ(edges.size(), 1U) << angle << " " << sigma;
      const EdgeChain& edge = edges.front();
      EXPECT_GT((edge.back() - edge.front()).norm(), 70.0);
      // Where the edge leaves the image, its reflection bends it.
      for (const Eigen::Vector2d& point : edge)
      {
        if (point.minCoeff() > 8.0 && point.maxCoeff() < 71.0)
        {
          EXPECT_NEAR(normal.dot(point - Eigen::Vector2d(40.3, 39.8)), 0.0, 0.1) << angle << " " << sigma;
        }
      }
    }
  }
}

TEST(Edges, HaveTheBrighterSideOnTheLeft)
{
  for (int i = 0; i < 24; ++i)
  {
    const double angle = 0.01 + i * M_PI / 12.0;
    const std::vector<EdgeChain> edges = detectEdges(straightEdge(angle, 60.0), EdgeParams());
    ASSERT_EQ(edges.size(), 1U);
    const Eigen::Vector2d way = edges.front().back() - edges.front().front();
    // v points down, so that the left of (1, 0) is (0, -1).
    const Eigen::Vector2d left(way.y(), -way.x());
    EXPECT_GT(left.normalized().dot(Eigen::Vector2d(std::cos(angle), std::sin(angle))), 0.99) << angle;
  }
}

TEST(Edges, AreOneClosedChainRoundADisc)
{
  const std::vector<EdgeChain> edges = detectEdges(disc(), EdgeParams());
  ASSERT_EQ(edges.size(), 1U);
  const EdgeChain& edge = edges.front();
  EXPECT_EQ(edge.front(), edge.back());
  double turn = 0.0;
  for (std::size_t i = 0; i < edge.size(); ++i)
  {
    const Eigen::Vector2d ray = edge[i] - Eigen::Vector2d(50.2, 49.6);
    EXPECT_NEAR(ray.norm(), 30.0, 0.1);
    const Eigen::Vector2d next = edge[(i + 1) % edge.size()] - Eigen::Vector2d(50.2, 49.6);
    turn += std::atan2(ray.x() * next.y() - ray.y() * next.x(), ray.dot(next));
  }
  // The bright disc stays on the left: counterclockwise as one sees it, which is the negative sense with v down.
  EXPECT_NEAR(turn, -2.0 * M_PI, 1e-6);
}

TEST(Edges, MeasureTheirSteepnessInGreyLevelsAPixel)
{
  // A step of height c, averaged over pixels and smoothed by sigma, is c / sqrt(2 pi (sigma² + 1/12)) steep.
  for (const double sigma : { 0.8, 1.0, 1.5, 3.0 })
  {
    const double steepness = 100.0 / std::sqrt(2.0 * M_PI * (sigma * sigma + 1.0 / 12.0));
    EdgeParams params;
    params.sigma = sigma;
    params.high_threshold = 0.95 * steepness;
    EXPECT_EQ(detectEdges(straightEdge(0.4, 100.0), params).size(), 1U) << sigma;
    params.high_threshold = 1.05 * steepness;
    EXPECT_TRUE(detectEdges(straightEdge(0.4, 100.0), params).empty()) << sigma;
  }
}

TEST(Edges, AreKeptWholeWhenSomePixelIsSteep)
{
  // Along v = 20 the step falls from 30 to 8 grey levels, along v = 60 it is 8 all the way, along v = 100 30 to 0.
  const cv::Mat picture = drawnPicture(cv::Size(200, 120), [](const Eigen::Vector2d& point) {
    const double along = point.x() / 199.0;
    return 60.0 + (point.y() > 20.2 ? 30.0 - 22.0 * along : 0.0) + (point.y() > 60.2 ? 8.0 : 0.0) +
           (point.y() > 100.2 ? 30.0 - 30.0 * along : 0.0);
  });
  EdgeParams params;
  params.low_threshold = 2.0;
  params.high_threshold = 4.0;
  const std::vector<EdgeChain> edges = detectEdges(picture, params);
  ASSERT_EQ(edges.size(), 2U);
  for (const EdgeChain& edge : edges)
  {
    const auto ends = std::minmax(edge.front().x(), edge.back().x());
    EXPECT_LT(ends.first, 4.0);
    if (edge.front().y() < 60.0)
    {
      EXPECT_GT(ends.second, 195.0);
    }
    else
    {
      // 2 grey levels/px are a step of 5.2.
      EXPECT_NEAR(ends.second, 199.0 * (1.0 - 5.2 / 30.0), 8.0);
    }
  }
  params.high_threshold = 2.0;
  EXPECT_EQ(detectEdges(picture, params).size(), 3U);
  params.low_threshold = 4.0;
  params.high_threshold = 4.0;
  EXPECT_LT(pointsOf(detectEdges(picture, params)), 340U);
}

TEST(Edges, EndAtAJunction)
{
  // A bright half above, two darker quarters below: the edge between those ends where it meets the other.
  const cv::Mat picture = drawnPicture(cv::Size(100, 100), [](const Eigen::Vector2d& point) {
    return point.y() < 40.3 ? 200.0 : (point.x() < 52.1 ? 40.0 : 110.0);
  });
  const std::vector<EdgeChain> edges = detectEdges(picture, EdgeParams());
  ASSERT_EQ(edges.size(), 2U);
  const bool first_is_longer = edges[0].size() > edges[1].size();
  const EdgeChain& through = edges[first_is_longer ? 0 : 1];
  const EdgeChain& stem = edges[first_is_longer ? 1 : 0];
  for (const Eigen::Vector2d& point : through)
  {
    EXPECT_NEAR(point.y(), 40.3, 0.6);
  }
  for (const Eigen::Vector2d& point : stem)
  {
    EXPECT_NEAR(point.x(), 52.1, 1.5);
    EXPECT_GT(point.y(), 40.3);
  }
  EXPECT_LT(std::min(stem.front().y(), stem.back().y()), 44.0);
}

TEST(Edges, AreConnectedAndShareNoPoints)
{
  EdgeParams params;
  params.min_points = 2;
  std::set<std::pair<double, double>> seen;
  for (const EdgeChain& edge : detectEdges(texturedPicture(1), params))
  {
    const bool closed = edge.front() == edge.back();
    for (std::size_t i = 0; i < edge.size(); ++i)
    {
      EXPECT_TRUE(seen.emplace(edge[i].x(), edge[i].y()).second || (closed && i + 1 == edge.size()));
      if (i > 0)
      {
        EXPECT_LE((edge[i] - edge[i - 1]).norm(), 4.0);
      }
    }
  }
  EXPECT_GT(seen.size(), 10000U);
}

TEST(Edges, HaveThePointsAskedFor)
{
  EdgeParams params;
  params.min_points = 40;
  const std::vector<EdgeChain> edges = detectEdges(texturedPicture(2), params);
  ASSERT_GT(edges.size(), 20U);
  for (const EdgeChain& edge : edges)
  {
    EXPECT_GE(edge.size(), 40U);
  }
}

TEST(Edges, OfARegionAreThoseOfTheImage)
{
  const cv::Mat picture = texturedPicture(3);
  EdgeParams params;
  params.high_threshold = params.low_threshold;  // or else what lies outside decides
  params.min_points = 2;
  const cv::Rect region(100, 80, 150, 120);
  std::set<std::pair<float, float>> all;
  std::size_t inside = 0;
  for (const EdgeChain& edge : detectEdges(picture, params))
  {
    for (const Eigen::Vector2d& point : edge)
    {
      all.emplace(static_cast<float>(point.x()), static_cast<float>(point.y()));
      // A pixel's point is half a pixel away at most.
      inside += point.x() >= 100.5 && point.x() < 248.5 && point.y() >= 80.5 && point.y() < 198.5 ? 1U : 0U;
    }
  }
  const std::vector<EdgeChain> edges = detectEdges(picture, params, region);
  EXPECT_GE(pointsOf(edges), inside);
  for (const EdgeChain& edge : edges)
  {
    for (const Eigen::Vector2d& point : edge)
    {
      EXPECT_GE(point.x(), 99.5);
      EXPECT_LE(point.x(), 249.5);
      EXPECT_GE(point.y(), 79.5);
      EXPECT_LE(point.y(), 199.5);
      const auto same = all.lower_bound({ static_cast<float>(point.x()) - 1e-3F, 0.0F });
      const bool found = std::any_of(same, all.end(), [&](const std::pair<float, float>& other) {
        return std::hypot(other.first - point.x(), other.second - point.y()) < 2e-3;
      });
      EXPECT_TRUE(found) << point.transpose();
    }
  }
  EXPECT_TRUE(detectEdges(picture, params, cv::Rect(1000, 1000, 50, 50)).empty());
}

TEST(Edges, OfAPartOfAnImageAreThoseOfItsCopy)
{
  const cv::Mat part = texturedPicture(4)(cv::Rect(31, 17, 200, 150));
  EXPECT_EQ(detectEdges(part, EdgeParams()), detectEdges(part.clone(), EdgeParams()));
}

TEST(Edges, AreNotMadeByNoise)
{
  const cv::Mat flat(200, 300, CV_8UC1, cv::Scalar(120));
  EXPECT_TRUE(detectEdges(disturbed(flat, 1.0, 0.0, 2.0), EdgeParams()).empty());
  EdgeParams coarse;
  coarse.sigma = 2.0;
  EXPECT_TRUE(detectEdges(disturbed(flat, 1.0, 0.0, 8.0), coarse).empty());
}

TEST(Edges, OfNothingAreNone)
{
  EXPECT_TRUE(detectEdges(cv::Mat(100, 120, CV_8UC1, cv::Scalar(77)), EdgeParams()).empty());
  EXPECT_TRUE(detectEdges(cv::Mat(), EdgeParams()).empty());
  for (const cv::Size& size : { cv::Size(1, 1), cv::Size(2, 3), cv::Size(4, 4), cv::Size(1, 90) })
  {
    cv::Mat tiny(size, CV_8UC1);
    cv::RNG(1).fill(tiny, cv::RNG::UNIFORM, 0, 256);
    EXPECT_TRUE(detectEdges(tiny, EdgeParams()).empty()) << size;
  }
  cv::Mat small(9, 9, CV_8UC1);
  cv::RNG(2).fill(small, cv::RNG::UNIFORM, 0, 256);
  EdgeParams coarse;
  coarse.sigma = 20.0;  // the kernel is larger than the image
  EXPECT_NO_THROW(detectEdges(small, coarse));
}

TEST(Edges, NeedAGreyImage)
{
  EXPECT_THROW(detectEdges(cv::Mat(50, 50, CV_8UC3, cv::Scalar::all(0)), EdgeParams()), std::invalid_argument);
  EXPECT_THROW(detectEdges(cv::Mat(50, 50, CV_32F, cv::Scalar(0)), EdgeParams()), std::invalid_argument);
}

TEST(Edges, NameAllFaultsOfTheirParameters)
{
  EXPECT_TRUE(EdgeParams().validate().empty());
  EdgeParams params;
  params.sigma = 0.5;
  params.low_threshold = 0.0;
  params.high_threshold = -1.0;
  params.min_points = 1;
  EXPECT_EQ(params.validate().size(), 4U);
  params.sigma = params.low_threshold = params.high_threshold = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 4U);
}

}  // namespace
