// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/line_segments.h"

#include "support/drawn_picture.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace
{
using view_servo::detectLineSegments;
using view_servo::directedByContrast;
using view_servo::LineSegmentParams;
using view_servo::Segment;
using view_servo::segmentContrast;
using view_servo::SegmentDetector;
using view_servo::Segments;
using view_servo::test::disturbed;
using view_servo::test::drawnPicture;
using view_servo::test::isInside;
using view_servo::test::Polygon;
using view_servo::test::texturedPicture;

struct Patch
{
  Polygon polygon;
  double grey;
};

constexpr double GROUND = 110.0;

/** Polygons clear of each other, some brighter than the ground and some darker. */
const std::vector<Patch>& patches()
{
  static const std::vector<Patch> scene = {
    { { { 30.2, 25.7 }, { 130.6, 40.1 }, { 120.3, 90.4 }, { 24.9, 84.6 } }, 190.0 },
    { { { 185.4, 24.3 }, { 244.7, 40.2 }, { 250.1, 104.8 }, { 204.6, 118.2 }, { 164.7, 81.9 } }, 40.0 },
    { { { 60.0, 120.0 }, { 110.0, 120.0 }, { 110.0, 200.0 }, { 60.0, 200.0 } }, 60.0 },
    { { { 205.5, 140.5 }, { 255.5, 190.5 }, { 205.5, 240.5 }, { 155.5, 190.5 } }, 170.0 },
    { { { 290.3, 30.2 }, { 345.1, 36.8 }, { 338.7, 126.4 }, { 283.2, 121.9 } }, 220.0 },
  };
  return scene;
}

cv::Mat patchesPicture()
{
  static const cv::Mat picture = drawnPicture(cv::Size(370, 260), [](const Eigen::Vector2d& point) {
    const auto patch = std::find_if(patches().begin(), patches().end(),
                                    [&](const Patch& candidate) { return isInside(candidate.polygon, point); });
    return patch == patches().end() ? GROUND : patch->grey;
  });
  return picture;
}

/** The sides of the patches with the brighter side on the left. */
Segments trueSegments()
{
  Segments segments;
  for (const Patch& patch : patches())
  {
    for (std::size_t i = 0; i < patch.polygon.size(); ++i)
    {
      // Clockwise round it, a polygon is on the right.
      const Segment side = { patch.polygon[i], patch.polygon[(i + 1) % patch.polygon.size()] };
      segments.push_back(patch.grey > GROUND ? side.reversed() : side);
    }
  }
  return segments;
}

/** How many of the true segments are found just once, with ends as close as `max_distance` [px]. */
std::ptrdiff_t countTrueSegments(const Segments& found, double max_distance, double max_angle_deg)
{
  const Segments truth = trueSegments();
  return std::count_if(truth.begin(), truth.end(), [&](const Segment& side) {
    return std::count_if(found.begin(), found.end(), [&](const Segment& segment) {
             return (segment.start - side.start).norm() < max_distance &&
                    (segment.end - side.end).norm() < max_distance &&
                    segment.direction().dot(side.direction()) > std::cos(max_angle_deg * M_PI / 180.0);
           }) == 1;
  });
}

/** Every true segment is found once, and nothing else is. */
void expectTrueSegments(const Segments& found, double max_distance, double max_angle_deg)
{
  EXPECT_EQ(found.size(), trueSegments().size());
  EXPECT_EQ(countTrueSegments(found, max_distance, max_angle_deg), static_cast<std::ptrdiff_t>(trueSegments().size()));
}

/** Brighter by 60 grey levels above the line from (0, 30.5) to the right. */
cv::Mat brightAbove()
{
  cv::Mat picture(80, 100, CV_8UC1, cv::Scalar(100));
  picture.rowRange(0, 31).setTo(160);
  return picture;
}

/** The edge v = 40 + amplitude sin(2 pi u / 60), 300 px long. */
cv::Mat wave(double amplitude)
{
  return drawnPicture(cv::Size(300, 80), [&](const Eigen::Vector2d& point) {
    return point.y() > 40.0 + amplitude * std::sin(point.x() * 2.0 * M_PI / 60.0) ? 60.0 : 180.0;
  });
}

TEST(LineSegments, AreTheSidesOfPolygons)
{
  expectTrueSegments(detectLineSegments(patchesPicture(), LineSegmentParams()), 0.1, 0.1);
}

TEST(LineSegments, AreTheSidesOfPolygonsUnderNoise)
{
  // Where noise breaks an edge at a corner, its sides end a pixel or two before it.
  std::size_t found = 0;
  std::ptrdiff_t right = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    const Segments segments = detectLineSegments(disturbed(patchesPicture(), 1.0, 0.0, 5.0, seed), LineSegmentParams());
    found += segments.size();
    right += countTrueSegments(segments, 1.0, 0.2);
  }
  const std::size_t all = 10 * trueSegments().size();
  EXPECT_NEAR(static_cast<double>(found), static_cast<double>(all), 2.0);
  EXPECT_GE(right, static_cast<std::ptrdiff_t>(all) - 4);
}

TEST(LineSegments, AreTheSidesOfPolygonsAtACoarseScale)
{
  LineSegmentParams params;
  params.sigma = 2.0;
  expectTrueSegments(detectLineSegments(disturbed(patchesPicture(), 1.0, 0.0, 5.0), params), 2.0, 0.4);
}

TEST(LineSegments, AreTheSidesOfPolygonsUnderAnotherLight)
{
  expectTrueSegments(detectLineSegments(disturbed(patchesPicture(), 0.3, 90.0, 1.5), LineSegmentParams()), 1.0, 0.2);
}

TEST(LineSegments, OfLsdAreTheSidesOfPolygons)
{
  LineSegmentParams params;
  params.detector = SegmentDetector::LSD;
  if (!view_servo::lsdAvailable())
  {
    EXPECT_THROW(detectLineSegments(patchesPicture(), params), std::runtime_error);
    EXPECT_EQ(params.validate().size(), 1U);
    return;
  }
  expectTrueSegments(detectLineSegments(patchesPicture(), params), 2.5, 0.5);
  // In a region they are at the same places of the whole image.
  const Segments some = detectLineSegments(patchesPicture(), params, cv::Rect(10, 10, 135, 95));
  ASSERT_EQ(some.size(), 4U);
  for (const Segment& segment : some)
  {
    EXPECT_GT(std::min(segment.start.x(), segment.end.x()), 20.0);
    EXPECT_GT(std::max(segment.start.y(), segment.end.y()), 35.0);
  }
}

TEST(LineSegments, AreDirectedByTheirContrast)
{
  for (const double sigma : { 1.0, 2.0 })
  {
    LineSegmentParams params;
    params.sigma = sigma;
    const cv::Mat picture = texturedPicture(1);
    const Segments segments = detectLineSegments(picture, params);
    ASSERT_GT(segments.size(), 200U);
    for (const Segment& segment : segments)
    {
      EXPECT_GT(segmentContrast(picture, segment), 0.0);
    }
  }
}

TEST(LineSegments, AreTheLongestInOrder)
{
  LineSegmentParams params;
  params.min_length = 8.0;
  const cv::Mat picture = texturedPicture(2);
  const Segments all = detectLineSegments(picture, params);
  ASSERT_GT(all.size(), 200U);
  EXPECT_GE(all.back().length(), 8.0);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(),
                             [](const Segment& a, const Segment& b) { return a.length() > b.length(); }));
  params.max_segments = 50;
  const Segments longest = detectLineSegments(picture, params);
  ASSERT_EQ(longest.size(), 50U);
  for (std::size_t i = 0; i < longest.size(); ++i)
  {
    EXPECT_EQ(longest[i].start, all[i].start);
    EXPECT_EQ(longest[i].end, all[i].end);
  }
}

TEST(LineSegments, FollowACurveClosely)
{
  for (const double radius : { 20.0, 60.0, 90.0 })
  {
    const Eigen::Vector2d centre(100.3, 99.8);
    const cv::Mat picture = drawnPicture(cv::Size(200, 200), [&](const Eigen::Vector2d& point) {
      return (point - centre).norm() < radius ? 180.0 : 60.0;
    });
    for (const Segment& segment : detectLineSegments(picture, LineSegmentParams()))
    {
      EXPECT_NEAR((segment.start - centre).norm(), radius, 1.5);
      EXPECT_NEAR((segment.midpoint() - centre).norm(), radius, 0.8);
      EXPECT_NEAR((segment.end - centre).norm(), radius, 1.5);
    }
  }
}

TEST(LineSegments, AreDividedWhereThePartsAreMoreSignificant)
{
  // A quarter of a pixel up and down is noise: one segment.
  const Segments straight = detectLineSegments(wave(0.25), LineSegmentParams());
  ASSERT_EQ(straight.size(), 1U);
  EXPECT_GT(straight.front().length(), 290.0);
  EXPECT_NEAR(straight.front().start.y(), 40.0, 0.25);
  EXPECT_NEAR(straight.front().end.y(), 40.0, 0.25);
  // Even if it is not, the parts are shorter by more than they are straighter.
  LineSegmentParams fine;
  fine.min_deviation = 0.1;
  EXPECT_EQ(detectLineSegments(wave(0.25), fine).size(), 1U);
  // Five pixels are a curve: its rises and falls, none from one wave to the next.
  const Segments curved = detectLineSegments(wave(5.0), LineSegmentParams());
  EXPECT_GE(curved.size(), 8U);
  EXPECT_LT(curved.front().length(), 40.0);
  // Unless such deviations are declared to be noise.
  LineSegmentParams rough;
  rough.min_deviation = 6.0;
  rough.max_deviation = 6.0;
  EXPECT_EQ(detectLineSegments(wave(5.0), rough).size(), 1U);
}

TEST(LineSegments, AreAsSignificantAsAskedFor)
{
  LineSegmentParams params;
  params.min_significance = 100.0;
  params.min_deviation = 0.5;
  const Segments segments = detectLineSegments(patchesPicture(), params);
  // Only sides of 50 px and more can be.
  const Segments truth = trueSegments();
  EXPECT_EQ(static_cast<std::ptrdiff_t>(segments.size()),
            std::count_if(truth.begin(), truth.end(), [](const Segment& side) { return side.length() > 50.5; }));
}

TEST(LineSegments, OfARegionAreInIt)
{
  const cv::Rect region(40, 20, 60, 190);
  const Segments segments = detectLineSegments(patchesPicture(), LineSegmentParams(), region);
  // Two sides of each of two polygons are cut off, the others are outside; of the third polygon's, three are inside.
  ASSERT_EQ(segments.size(), 5U);
  for (const Segment& segment : segments)
  {
    for (const Eigen::Vector2d& end : { segment.start, segment.end })
    {
      EXPECT_GE(end.x(), 39.0);
      EXPECT_LE(end.x(), 100.0);
      EXPECT_GE(end.y(), 19.0);
      EXPECT_LE(end.y(), 210.0);
    }
  }
  EXPECT_TRUE(detectLineSegments(patchesPicture(), LineSegmentParams(), cv::Rect(900, 0, 10, 10)).empty());
}

TEST(LineSegments, OfOneEdgeAreOne)
{
  const Segments segments = detectLineSegments(brightAbove(), LineSegmentParams());
  ASSERT_EQ(segments.size(), 1U);
  // To the right, for the bright half is above.
  EXPECT_LT(segments.front().start.x(), 4.0);
  EXPECT_GT(segments.front().end.x(), 95.0);
  EXPECT_NEAR(segments.front().start.y(), 30.5, 0.05);
  EXPECT_NEAR(segments.front().end.y(), 30.5, 0.05);
}

TEST(LineSegments, OfNothingAreNone)
{
  for (const SegmentDetector detector : { SegmentDetector::CANNY, SegmentDetector::LSD })
  {
    if (detector == SegmentDetector::LSD && !view_servo::lsdAvailable())
    {
      continue;
    }
    LineSegmentParams params;
    params.detector = detector;
    EXPECT_TRUE(detectLineSegments(cv::Mat(90, 120, CV_8UC1, cv::Scalar(50)), params).empty());
    EXPECT_TRUE(detectLineSegments(cv::Mat(), params).empty());
    for (const cv::Size& size : { cv::Size(1, 1), cv::Size(3, 2), cv::Size(6, 5), cv::Size(2, 80), cv::Size(80, 1) })
    {
      cv::Mat tiny(size, CV_8UC1);
      cv::RNG(1).fill(tiny, cv::RNG::UNIFORM, 0, 256);
      EXPECT_TRUE(detectLineSegments(tiny, params).empty()) << size;
    }
  }
}

TEST(LineSegments, AreFewInNoise)
{
  cv::Mat noise(480, 640, CV_8UC1);
  cv::RNG(5).fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_LT(detectLineSegments(noise, LineSegmentParams()).size(), 60U);
  LineSegmentParams params;
  params.min_length = 3.0;
  params.min_significance = 0.0;
  params.max_segments = 700;
  EXPECT_EQ(detectLineSegments(noise, params).size(), 700U);
}

TEST(LineSegments, FollowAVeryLongEdge)
{
  // Two spirals of some 28000 px, the edges of a dark band: divided along one of them many times.
  constexpr double PITCH = 10.0;
  const Eigen::Vector2d centre(300.0, 300.0);
  const auto phase = [&](const Eigen::Vector2d& point) {
    const Eigen::Vector2d ray = point - centre;
    return (ray.norm() - std::atan2(ray.y(), ray.x()) / (2.0 * M_PI) * PITCH) / PITCH;
  };
  cv::Mat picture(600, 600, CV_8UC1);
  for (int v = 0; v < picture.rows; ++v)
  {
    for (int u = 0; u < picture.cols; ++u)
    {
      picture.at<unsigned char>(v, u) =
          static_cast<unsigned char>(std::lround(130.0 + 80.0 * std::cos(2.0 * M_PI * phase({ u, v }))));
    }
  }
  const Segments segments = detectLineSegments(picture, LineSegmentParams());
  ASSERT_EQ(segments.size(), 1000U);
  for (const Segment& segment : segments)
  {
    // Edges are where the cosine is 0.
    EXPECT_NEAR(std::cos(2.0 * M_PI * phase(segment.start)), 0.0, 0.9);
    const double radius = (segment.midpoint() - centre).norm();
    EXPECT_LT(segment.length() * segment.length() / (8.0 * radius), 2.0);
  }
}

TEST(LineSegments, NeedAGreyImage)
{
  const cv::Mat colour(50, 50, CV_8UC3, cv::Scalar::all(0));
  const Segment segment = { { 10.0, 10.0 }, { 30.0, 10.0 } };
  EXPECT_THROW(detectLineSegments(colour, LineSegmentParams()), std::invalid_argument);
  EXPECT_THROW(segmentContrast(colour, segment), std::invalid_argument);
  EXPECT_THROW(directedByContrast(colour, { segment }), std::invalid_argument);
}

TEST(LineSegments, NameAllFaultsOfTheirParameters)
{
  EXPECT_TRUE(LineSegmentParams().validate().empty());
  LineSegmentParams params;
  params.sigma = 0.0;
  params.low_threshold = 0.0;
  params.high_threshold = -1.0;
  params.min_deviation = 0.0;
  params.max_deviation = -1.0;
  params.min_significance = -1.0;
  params.min_length = 0.0;
  params.max_segments = 0;
  EXPECT_EQ(params.validate().size(), 8U);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  params.sigma = params.low_threshold = params.high_threshold = nan;
  params.min_deviation = params.max_deviation = params.min_significance = params.min_length = nan;
  EXPECT_EQ(params.validate().size(), 8U);
}

TEST(SegmentContrast, IsTheLeftSidesMinusTheRightSides)
{
  const Segment right = { { 20.0, 30.5 }, { 70.0, 30.5 } };
  EXPECT_NEAR(segmentContrast(brightAbove(), right), 60.0, 1e-9);
  EXPECT_NEAR(segmentContrast(brightAbove(), right.reversed()), -60.0, 1e-9);
  const Segment across = { { 50.0, 10.0 }, { 50.0, 60.0 } };
  EXPECT_NEAR(segmentContrast(brightAbove(), across), 0.0, 1e-9);
}

TEST(SegmentContrast, LeavesOutWhatIsOutsideTheImage)
{
  const Segment half_outside = { { -50.0, 30.5 }, { 50.0, 30.5 } };
  EXPECT_NEAR(segmentContrast(brightAbove(), half_outside), 60.0, 1e-9);
  for (const Segment& segment : { Segment{ { 10.0, 0.0 }, { 60.0, 0.0 } }, Segment{ { 10.0, 79.0 }, { 60.0, 79.0 } },
                                  Segment{ { 500.0, 0.0 }, { 560.0, 70.0 } }, Segment{ { 10.0, 10.0 }, { 10.0, 10.0 } },
                                  Segment{ { std::numeric_limits<double>::quiet_NaN(), 10.0 }, { 60.0, 10.0 } },
                                  Segment{ { 10.0, 10.0 }, { std::numeric_limits<double>::infinity(), 10.0 } } })
  {
    EXPECT_TRUE(std::isnan(segmentContrast(brightAbove(), segment)));
  }
}

TEST(SegmentContrast, DirectsSegments)
{
  const Segments truth = trueSegments();
  Segments mixed = truth;
  for (std::size_t i = 0; i < mixed.size(); i += 2)
  {
    mixed[i] = mixed[i].reversed();
  }
  mixed.push_back({ { 5.0, 5.0 }, { 5.0, 5.0 } });        // says nothing
  mixed.push_back({ { 260.0, 20.0 }, { 260.0, 80.0 } });  // without contrast
  const Segments directed = directedByContrast(patchesPicture(), mixed);
  ASSERT_EQ(directed.size(), mixed.size());
  for (std::size_t i = 0; i < truth.size(); ++i)
  {
    EXPECT_EQ(directed[i].start, truth[i].start) << i;
    EXPECT_EQ(directed[i].end, truth[i].end) << i;
  }
  for (std::size_t i = truth.size(); i < mixed.size(); ++i)
  {
    EXPECT_EQ(directed[i].start, mixed[i].start);
    EXPECT_EQ(directed[i].end, mixed[i].end);
  }
  EXPECT_TRUE(directedByContrast(patchesPicture(), {}).empty());
}

}  // namespace
