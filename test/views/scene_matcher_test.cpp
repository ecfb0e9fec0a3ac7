// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/scene_matcher.h"

#include "support/corner_error.h"
#include "support/matched_views.h"
#include "support/room_corner.h"
#include "support/textured_plane.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
TEST(SceneMatcher, FindsTheFundamentalMatrixOfARoomCorner)
{
  const test::RoomCorner room;
  const ViewMatch result = test::matchScene(room.reference, room.current);
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  ASSERT_EQ(result.model, GeometryModel::FUNDAMENTAL) << result.message;
  double worst = 0.0;
  for (double u = 40.0; u < 640.0; u += 80.0)
  {
    for (double v = 40.0; v < 480.0; v += 80.0)
    {
      const Eigen::Vector2d at(u, v);
      const Eigen::Vector2d seen = transfer(u < 320.0 ? room.left : room.right, at);
      worst = std::max(worst, std::sqrt(sampsonError(result.matrix, { at, seen })));
    }
  }
  EXPECT_LT(worst, 1.0);
  EXPECT_GE(result.planes.size(), 2U);
  EXPECT_GT(result.inliers, 200);
  EXPECT_GT(result.log_significance, 100.0);
  const auto inliers = std::count_if(result.matches.begin(), result.matches.end(),
                                     [](const MatchedPoint& point) { return point.inlier; });
  EXPECT_EQ(inliers, result.inliers);
  EXPECT_FALSE(result.lines.empty());
  for (const MatchedLine& line : result.lines)
  {
    EXPECT_GE(line.plane, 0);
    EXPECT_LT(line.plane, static_cast<int>(result.planes.size()));
  }
}

TEST(SceneMatcher, SaysThatAPlaneIsOne)
{
  const Eigen::Matrix3d h = test::exampleHomography();
  const cv::Mat reference = test::texturedPicture(5, test::PICTURE_SIZE);
  const ViewMatch result = test::matchScene(reference, test::warpedPicture(reference, h));
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  EXPECT_EQ(result.model, GeometryModel::HOMOGRAPHY) << result.message;
  EXPECT_LT(test::cornerError(result.matrix, h, test::PICTURE_SIZE), 0.5);
}

TEST(SceneMatcher, FindsTheFundamentalMatrixOfALowRelief)
{
  // Before a wall hangs a board; the camera moves sideways, and the board by 3 px more than the wall: one plane would
  // explain all within 2 px.
  constexpr double PARALLAX = 3.0;  // [px]
  const cv::Rect board(180, 120, 300, 240);
  Eigen::Matrix3d wall = Eigen::Matrix3d::Identity();
  wall(0, 2) = -20.0;
  const cv::Mat reference = test::texturedPicture(31, test::PICTURE_SIZE);
  cv::Mat current = test::warpedPicture(reference, wall);
  const Eigen::Vector2d moved(-20.0 + PARALLAX, 0.0);
  reference(board).copyTo(current(board + cv::Point(static_cast<int>(moved.x()), 0)));
  const ViewMatch result = test::matchScene(reference, test::disturbed(current, 1.0, 0.0, 1.0));
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  ASSERT_EQ(result.model, GeometryModel::FUNDAMENTAL) << result.message;
  // What is still nearer moves in the same direction.
  for (const double parallax : { 0.0, PARALLAX, 5.0 * PARALLAX })
  {
    for (const Eigen::Vector2d& at : { Eigen::Vector2d(100.0, 100.0), Eigen::Vector2d(500.0, 240.0) })
    {
      const Eigen::Vector2d seen = at + Eigen::Vector2d(-20.0 + parallax, 0.0);
      EXPECT_LT(std::sqrt(sampsonError(result.matrix, { at, seen })), 1.0) << parallax << " px at " << at.transpose();
    }
  }
}

TEST(SceneMatcher, FindsTheBestPlaneWhereAHomographyIsAskedFor)
{
  const test::RoomCorner room;
  const SceneMatcher matcher{ SceneMatcherParams() };
  const PreparedImage reference(room.reference, cv::Rect(), matcher.features());
  const PreparedImage current(room.current, cv::Rect(), matcher.features());
  const ViewMatch result = matcher.match(reference, current, GeometryModel::HOMOGRAPHY);
  ASSERT_EQ(result.outcome, MatchOutcome::MATCHED) << result.message;
  EXPECT_EQ(result.model, GeometryModel::HOMOGRAPHY);
  const cv::Size half(test::PICTURE_SIZE.width / 2, test::PICTURE_SIZE.height);
  const Eigen::Matrix3d to_right = (Eigen::Matrix3d() << 1.0, 0.0, half.width, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0).finished();
  const double left_error = test::cornerError(result.matrix, room.left, half);
  const double right_error = test::cornerError(result.matrix * to_right, room.right * to_right, half);
  EXPECT_LT(std::min(left_error, right_error), 1.0);
  EXPECT_FALSE(result.lines.empty());
}

TEST(SceneMatcher, EndsEarlyWhenGivenUp)
{
  const test::RoomCorner room;
  const SceneMatcher matcher{ SceneMatcherParams() };
  const PreparedImage reference(room.reference, cv::Rect(), matcher.features());
  const PreparedImage current(room.current, cv::Rect(), matcher.features());
  const ViewMatch result = matcher.match(reference, current, GeometryModel::FUNDAMENTAL, [] { return true; });
  EXPECT_EQ(result.outcome, MatchOutcome::NO_GEOMETRY);
  EXPECT_EQ(result.message, "given up");
  EXPECT_TRUE(result.matrix.hasNaN());
}

TEST(SceneMatcher, SaysWhenNothingIsThere)
{
  const cv::Mat grey(240, 320, CV_8UC1, cv::Scalar(128));
  const ViewMatch result = test::matchScene(grey, grey);
  EXPECT_EQ(result.outcome, MatchOutcome::TOO_FEW_FEATURES);
  EXPECT_NE(result.message.find("too few corners"), std::string::npos) << result.message;
  EXPECT_NE(result.message.find("too few line segments"), std::string::npos) << result.message;
}

TEST(SceneMatcher, GivesTheSameAgain)
{
  const test::RoomCorner room;
  const ViewMatch first = test::matchScene(room.reference, room.current);
  const ViewMatch second = test::matchScene(room.reference, room.current);
  EXPECT_EQ(first.matrix, second.matrix);
  EXPECT_EQ(first.inliers, second.inliers);
}

TEST(SceneMatcher, NamesEveryFaultOfItsParameters)
{
  SceneMatcherParams params;
  params.inlier_threshold = 0.0;
  params.plane_correlation = 1.5;
  params.points.min_log_significance = -1.0;
  params.lines.min_quality = 2.0;
  EXPECT_EQ(params.validate().size(), 4U);
  EXPECT_THROW(SceneMatcher{ params }, std::invalid_argument);
}

}  // namespace view_servo
