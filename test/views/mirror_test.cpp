// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "views/mirror.h"
#include "support/matched_views.h"
#include "support/room_corner.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <string>

namespace view_servo
{
namespace
{
using test::MatchesOfAll;

const cv::Size SIZE(640, 480);

/** A front that is symmetric, with windows and a picture on each wing, among things that are not. */
cv::Mat symmetricFront()
{
  cv::Mat picture = test::texturedPicture(3, SIZE);
  cv::Mat wing = test::texturedPicture(4, cv::Size(120, 250));
  for (int row = 0; row < 3; ++row)
  {
    for (int column = 0; column < 2; ++column)
    {
      cv::rectangle(wing, cv::Rect(15 + 55 * column, 15 + 80 * row, 30 + 4 * row, 45 - 9 * column),
                    cv::Scalar(40 + 60 * row + 30 * column), cv::FILLED);
    }
  }
  cv::Mat front(250, 240, CV_8UC1);
  wing.copyTo(front(cv::Rect(0, 0, 120, 250)));
  cv::flip(wing, wing, 1);
  wing.copyTo(front(cv::Rect(120, 0, 120, 250)));
  front.copyTo(picture(cv::Rect(200, 115, 240, 250)));
  cv::GaussianBlur(picture, picture, cv::Size(), 0.8);
  return picture;
}

MatchesOfAll answers(const cv::Mat& current_image, bool refuse_mirrored = true)
{
  SceneMatcherParams params;
  params.points.refuse_mirrored = params.lines.refuse_mirrored = refuse_mirrored;
  return test::matchByAll(params, symmetricFront(), test::disturbed(current_image, 0.9, 5.0, 2.0));
}

cv::Mat mirrored(const cv::Mat& picture)
{
  cv::Mat result;
  cv::flip(picture, result, 1);
  return result;
}

}  // namespace

TEST(MirroredView, IsRefusedWhereWhatIsSymmetricMatches)
{
  const MatchesOfAll believing = answers(mirrored(symmetricFront()), false);
  EXPECT_TRUE(believing.points.outcome == MatchOutcome::MATCHED || believing.lines.outcome == MatchOutcome::MATCHED ||
              believing.scene.outcome == MatchOutcome::MATCHED)
      << "the picture is no test";
  const MatchesOfAll found = answers(mirrored(symmetricFront()));
  for (const ViewMatch& match : { found.points, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << match.message;
    EXPECT_TRUE(match.matrix.hasNaN());
    EXPECT_EQ(match.inliers, 0);
    EXPECT_TRUE(
        std::none_of(match.matches.begin(), match.matches.end(), [](const auto& point) { return point.inlier; }));
  }
  EXPECT_NE((found.points.message + found.lines.message + found.scene.message).find("mirror"), std::string::npos)
      << found.points.message << '\n'
      << found.lines.message << '\n'
      << found.scene.message;
}

TEST(MirroredView, IsRefusedByPointsWhereNothingIsSymmetric)
{
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    for (int seed = 0; seed < 2; ++seed)
    {
      const cv::Mat reference = test::texturedPicture(300 + seed);
      const ViewMatch match = test::matchPoints(PointViewMatcherParams(), reference, mirrored(reference), model);
      EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << "seed " << seed << ": " << match.message;
    }
  }
}

TEST(MirroredView, IsRefusedInARoom)
{
  const test::RoomCorner room;
  const ViewMatch plane = test::matchScene(room.reference, mirrored(room.reference));
  EXPECT_NE(plane.outcome, MatchOutcome::MATCHED) << plane.message;
  const ViewMatch corner = test::matchScene(room.reference, mirrored(room.current));
  EXPECT_NE(corner.outcome, MatchOutcome::MATCHED) << corner.message;
}

TEST(MirroredView, IsWeighedAgainstAGeometryWithoutPlanes)
{
  const PreparedImage reference(symmetricFront(), {}, FeatureParams());
  const PreparedImage current(test::disturbed(symmetricFront(), 0.9, 5.0, 2.0), {}, FeatureParams());
  Rng rng(1);
  EXPECT_TRUE(isMirrored(reference, 0, current, 0, {}, 0.0, rng)) << "the picture is no test";
  EXPECT_FALSE(isMirrored(reference, 0, current, 0, {}, 1000.0, rng));
}

TEST(MirroredView, IsNoneInFrontOfSymmetricThings)
{
  const MatchesOfAll found = answers(symmetricFront());
  for (const ViewMatch& match : { found.points, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::MATCHED) << match.message;
  }
}

}  // namespace view_servo
