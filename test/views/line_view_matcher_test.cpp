// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/line_view_matcher.h"

#include "support/corner_error.h"
#include "support/room_corner.h"
#include "support/synthetic_scene.h"
#include "support/textured_plane.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/line_homography.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <stdexcept>

namespace view_servo
{
namespace
{

const cv::Size SIZE(640, 480);

using test::RoomCorner;
using test::warpedPicture;

LineFeatures features(const cv::Mat& image, const LineMatcherParams& params)
{
  return { image, detectLineSegments(image, params.segments), params.features };
}

ViewMatch match(const cv::Mat& reference, const cv::Mat& current, GeometryModel model = GeometryModel::HOMOGRAPHY,
                LineGrouping groups = LineGrouping::TRIPLETS)
{
  const LineMatcherParams params;
  return LineViewMatcher(params).match(features(reference, params), features(current, params), model, groups);
}

int correct(const ViewMatch& result, const Eigen::Matrix3d& h)
{
  return static_cast<int>(std::count_if(result.lines.begin(), result.lines.end(), [&](const MatchedLine& line) {
    const auto mapped = transfer(h, line.reference);
    return mapped && compare(*mapped, line.current).distance < 2.0;
  }));
}

}  // namespace

class LineViewMatcherRollTest : public testing::TestWithParam<double>
{
};

TEST_P(LineViewMatcherRollTest, MatchesATurnedPlane)
{
  // A plane from another side, and turned about the optical axis.
  const double roll = GetParam() * M_PI / 180.0;
  Eigen::Matrix3d about_middle = Eigen::Matrix3d::Identity();
  about_middle.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(roll).toRotationMatrix();
  const Eigen::Vector2d middle(0.5 * (SIZE.width - 1), 0.5 * (SIZE.height - 1));
  about_middle.topRightCorner<2, 1>() = middle - about_middle.topLeftCorner<2, 2>() * middle;
  const Eigen::Matrix3d h = about_middle * test::exampleHomography();
  const cv::Mat reference = test::texturedPicture(5, SIZE);
  const ViewMatch result = match(reference, warpedPicture(reference, h));
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  EXPECT_GE(result.lines.size(), 40U);
  EXPECT_GE(correct(result, h), static_cast<int>(0.9 * static_cast<double>(result.lines.size())));
  EXPECT_LT(test::cornerError(result.matrix, h, SIZE), 3.0);
  EXPECT_EQ(result.planes.size(), 1U);
  EXPECT_TRUE(result.fundamental.hasNaN()) << "one plane leaves F open";
}

INSTANTIATE_TEST_SUITE_P(Degrees, LineViewMatcherRollTest, testing::Values(0.0, 30.0, 90.0, 180.0));

TEST(LineViewMatcher, PairsOfSegmentsMatchToo)
{
  const Eigen::Matrix3d h = test::exampleHomography();
  const cv::Mat reference = test::texturedPicture(6, SIZE);
  const ViewMatch result =
      match(reference, warpedPicture(reference, h), GeometryModel::HOMOGRAPHY, LineGrouping::PAIRS);
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  EXPECT_GE(correct(result, h), 30);
}

TEST(LineViewMatcher, FindsTwoPlanesOfARoomCorner)
{
  const RoomCorner room;
  const ViewMatch result = match(room.reference, room.current, GeometryModel::FUNDAMENTAL);
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  ASSERT_GE(result.planes.size(), 2U);
  // Each of the walls is one of the first two planes, and its lines are on it.
  for (const bool is_left : { true, false })
  {
    const Eigen::Matrix3d& truth = is_left ? room.left : room.right;
    const auto error = [&](std::size_t plane) {
      double sum = 0.0;
      int count = 0;
      for (const MatchedLine& line : result.lines)
      {
        if ((line.reference.midpoint().x() < SIZE.width / 2.0) == is_left && line.plane == static_cast<int>(plane))
        {
          const Eigen::Vector2d at = line.reference.midpoint();
          sum += ((truth * at.homogeneous()).hnormalized() - (result.planes[plane] * at.homogeneous()).hnormalized())
                     .norm();
          ++count;
        }
      }
      return count < 8 ? 1e9 : sum / count;
    };
    EXPECT_LT(std::min(error(0), error(1)), 1.5);
  }
  // The epipolar geometry holds where nothing was matched, too.
  double sum = 0.0;
  int count = 0;
  for (int u = 40; u < SIZE.width; u += 40)
  {
    for (int v = 40; v < SIZE.height; v += 40)
    {
      const Eigen::Vector2d at(u, v);
      const Eigen::Matrix3d& h = u < SIZE.width / 2 ? room.left : room.right;
      sum += std::sqrt(sampsonError(result.fundamental, { at, (h * at.homogeneous()).hnormalized() }));
      ++count;
    }
  }
  EXPECT_LT(sum / count, 1.5);
}

TEST(LineViewMatcher, DifferentScenesDoNotMatch)
{
  for (int seed = 30; seed < 36; ++seed)
  {
    const ViewMatch result = match(test::texturedPicture(static_cast<std::uint64_t>(seed), SIZE),
                                   test::texturedPicture(static_cast<std::uint64_t>(seed + 100), SIZE));
    EXPECT_NE(result.outcome, MatchOutcome::MATCHED) << result.message;
    EXPECT_LE(result.lines.size(), 6U);
    EXPECT_TRUE(result.matrix.hasNaN());
    EXPECT_FALSE(result.message.empty());
  }
}

TEST(LineViewMatcher, NamesTooFewSegments)
{
  const cv::Mat blank(SIZE, CV_8UC1, cv::Scalar(128));
  cv::Mat one = blank.clone();
  one(cv::Rect(200, 0, 300, SIZE.height)).setTo(60);
  const cv::Mat scene = test::texturedPicture(5, SIZE);
  for (const cv::Mat& poor : { blank, one })
  {
    for (const bool first : { true, false })
    {
      const ViewMatch result = first ? match(poor, scene) : match(scene, poor);
      EXPECT_EQ(result.outcome, MatchOutcome::TOO_FEW_FEATURES);
      EXPECT_NE(result.message.find("too few line segments"), std::string::npos);
      EXPECT_TRUE(result.lines.empty());
    }
  }
}

TEST(LineViewMatcher, IndicesAreThoseOfTheSegmentsGiven)
{
  const LineMatcherParams params;
  const Eigen::Matrix3d h = test::exampleHomography();
  const cv::Mat reference = test::texturedPicture(7, SIZE);
  const cv::Mat current = warpedPicture(reference, h);
  Segments from = detectLineSegments(reference, params.segments);
  Segments to = detectLineSegments(current, params.segments);
  std::mt19937_64 rng(2);
  std::shuffle(from.begin(), from.end(), rng);
  std::shuffle(to.begin(), to.end(), rng);
  const ViewMatch result = LineViewMatcher(params).match(LineFeatures(reference, from, params.features),
                                                         LineFeatures(current, to, params.features),
                                                         GeometryModel::HOMOGRAPHY, LineGrouping::TRIPLETS);
  ASSERT_FALSE(result.lines.empty());
  std::set<int> references;
  std::set<int> currents;
  for (std::size_t i = 0; i < result.lines.size(); ++i)
  {
    const MatchedLine& line = result.lines[i];
    EXPECT_EQ(line.reference.start, from[static_cast<std::size_t>(line.reference_index)].start);
    EXPECT_EQ(line.current.end, to[static_cast<std::size_t>(line.current_index)].end);
    EXPECT_TRUE(references.insert(line.reference_index).second);
    EXPECT_TRUE(currents.insert(line.current_index).second);
    EXPECT_TRUE(i == 0 || result.lines[i - 1].score >= line.score);
  }
}

TEST(LineViewMatcher, FiveThousandSegmentsAreAnswered)
{
  // Segments anywhere, also outside the image: nothing to find, in bounded time and memory.
  const LineMatcherParams params;
  const cv::Mat image = test::texturedPicture(9, SIZE);
  std::mt19937_64 rng(12);
  const auto random = [&] {
    Segments segments;
    for (int i = 0; i < 5000; ++i)
    {
      const Eigen::Vector2d start(uniform(rng, -50.0, 700.0), uniform(rng, -50.0, 550.0));
      const double angle = uniform(rng, -M_PI, M_PI);
      segments.push_back(
          { start, start + uniform(rng, 5.0, 40.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle)) });
    }
    return LineFeatures(image, directedByContrast(image, segments), params.features);
  };
  const ViewMatch result =
      LineViewMatcher(params).match(random(), random(), GeometryModel::HOMOGRAPHY, LineGrouping::TRIPLETS);
  EXPECT_NE(result.outcome, MatchOutcome::MATCHED) << result.message;
}

TEST(LineViewMatcher, SameInputSameResult)
{
  const cv::Mat reference = test::texturedPicture(8, SIZE);
  const cv::Mat current = warpedPicture(reference, test::exampleHomography());
  const ViewMatch first = match(reference, current);
  const ViewMatch second = match(reference, current);
  ASSERT_EQ(first.lines.size(), second.lines.size());
  EXPECT_EQ(first.matrix, second.matrix);
  for (std::size_t i = 0; i < first.lines.size(); ++i)
  {
    EXPECT_EQ(first.lines[i].reference_index, second.lines[i].reference_index);
    EXPECT_EQ(first.lines[i].current_index, second.lines[i].current_index);
  }
}

TEST(LineViewMatcher, NamesAllFaultsOfItsParameters)
{
  LineMatcherParams params;
  params.planes.threshold = 0.0;
  params.planes.min_lines = 4;
  params.planes.max_planes = 0;
  params.min_quality = 1.0;
  params.regions.max_candidates = 0;
  params.regions.max_trials = 0;
  params.regions.max_companions = 1;
  params.regions.max_hypotheses = 0;
  params.features.neighbours = 5;
  EXPECT_EQ(params.validate().size(), 9U);
  EXPECT_THROW(LineViewMatcher{ params }, std::invalid_argument);
}

}  // namespace view_servo
