// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "support/corner_error.h"
#include "support/matched_views.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>

namespace view_servo
{
namespace
{
using test::MatchesOfAll;

const cv::Size WALL_SIZE(640, 480);
constexpr int PERIOD = 72;  // [px]

/** A wall of windows, all alike, each of a few panes. */
cv::Mat wall(std::uint64_t seed, const cv::Size& size)
{
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<int> grey(20, 230);
  std::uniform_int_distribution<int> at(6, 38);
  std::uniform_int_distribution<int> side(12, 26);
  cv::Mat window(PERIOD, PERIOD, CV_8UC1, cv::Scalar(grey(random)));
  for (int pane = 0; pane < 4; ++pane)
  {
    cv::rectangle(window, cv::Rect(at(random), at(random), side(random), side(random)), cv::Scalar(grey(random)),
                  cv::FILLED);
  }
  const cv::Mat all = cv::repeat(window, size.height / PERIOD + 1, size.width / PERIOD + 1);
  return all(cv::Rect(cv::Point(), size)).clone();
}

/** @param turn of the camera [degrees] */
cv::Mat photographed(const cv::Mat& picture, double turn = 0.0)
{
  const cv::Point2f middle(0.5F * static_cast<float>(picture.cols), 0.5F * static_cast<float>(picture.rows));
  cv::Mat blurred;
  cv::warpAffine(picture, blurred, cv::getRotationMatrix2D(middle, turn, 1.0), picture.size(), cv::INTER_LINEAR,
                 cv::BORDER_REPLICATE);
  cv::GaussianBlur(blurred, blurred, cv::Size(), 0.8);
  return test::disturbed(blurred, 1.0, 0.0, 2.0);
}

MatchesOfAll answers(const cv::Mat& reference, const cv::Mat& current, bool unique = true)
{
  SceneMatcherParams params;
  params.points.unique = params.lines.unique = unique;
  return test::matchByAll(params, reference, current);
}

}  // namespace

class RepeatedWindowsTest : public testing::TestWithParam<std::uint64_t>
{
};

TEST_P(RepeatedWindowsTest, AreRefusedByAll)
{
  // The camera has moved by one window: a match that is one window off is as good as the right one.
  const cv::Mat picture = wall(GetParam(), WALL_SIZE + cv::Size(PERIOD, 0));
  const MatchesOfAll found = answers(photographed(picture(cv::Rect(cv::Point(0, 0), WALL_SIZE))),
                                     photographed(picture(cv::Rect(cv::Point(PERIOD, 0), WALL_SIZE))));
  for (const ViewMatch& match : { found.points, found.points_with_depth, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << match.message;
    EXPECT_TRUE(match.matrix.hasNaN());
    EXPECT_TRUE(match.fundamental.hasNaN());
    EXPECT_TRUE(
        std::none_of(match.matches.begin(), match.matches.end(), [](const auto& point) { return point.inlier; }));
  }
  EXPECT_NE(found.points.message.find("repeats itself"), std::string::npos) << found.points.message;
  EXPECT_NE(found.lines.message.find("repeats itself"), std::string::npos) << found.lines.message;
  EXPECT_NE(found.scene.message.find("repeats itself"), std::string::npos) << found.scene.message;
}

TEST_P(RepeatedWindowsTest, AreRefusedByAllWhenTheCameraHasTurned)
{
  const cv::Mat picture = wall(GetParam(), WALL_SIZE + cv::Size(PERIOD, 0));
  const MatchesOfAll found = answers(photographed(picture(cv::Rect(cv::Point(0, 0), WALL_SIZE)), -2.0),
                                     photographed(picture(cv::Rect(cv::Point(PERIOD, 0), WALL_SIZE)), 2.0));
  for (const ViewMatch& match : { found.points, found.points_with_depth, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << match.message;
  }
}

INSTANTIATE_TEST_SUITE_P(Walls, RepeatedWindowsTest, testing::Values(1, 2, 3));

TEST(RepeatedStructure, IsAllowedWhereThatIsAskedFor)
{
  const cv::Mat picture = wall(1, WALL_SIZE);
  const MatchesOfAll found = answers(photographed(picture), photographed(picture), false);
  for (const ViewMatch& match : { found.points, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::MATCHED) << match.message;
  }
}

TEST(RepeatedStructure, IsNoneWhereMostOfTheViewIsUnique)
{
  // Windows between pictures of which each is another.
  cv::Mat picture = test::texturedPicture(7, WALL_SIZE);
  wall(1, cv::Size(4 * PERIOD, 3 * PERIOD)).copyTo(picture(cv::Rect(160, 120, 4 * PERIOD, 3 * PERIOD)));
  const Eigen::Matrix3d h = test::exampleHomography();
  const MatchesOfAll found = answers(photographed(picture), photographed(test::warpedPicture(picture, h, WALL_SIZE)));
  for (const ViewMatch& match : { found.points, found.lines, found.scene })
  {
    EXPECT_EQ(match.outcome, MatchOutcome::MATCHED) << match.message;
    EXPECT_LT(test::cornerError(match.matrix, h, WALL_SIZE), 2.0);
  }
}

}  // namespace view_servo
