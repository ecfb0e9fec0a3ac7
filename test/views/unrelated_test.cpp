// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "support/textured_plane.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>

namespace view_servo
{
namespace
{
ViewMatch matchPoints(const cv::Mat& reference, const cv::Mat& current, GeometryModel model)
{
  const PointViewMatcher matcher{ PointViewMatcherParams() };
  const FeatureParams features = matcher.params().points;
  return matcher.match(PreparedImage(reference, cv::Rect(), features), PreparedImage(current, cv::Rect(), features),
                       model);
}

ViewMatch matchScene(const cv::Mat& reference, const cv::Mat& current)
{
  const SceneMatcher matcher{ SceneMatcherParams() };
  const FeatureParams features = matcher.features();
  return matcher.match(PreparedImage(reference, cv::Rect(), features), PreparedImage(current, cv::Rect(), features));
}

}  // namespace

TEST(PointViewMatcher, FindsNothingInUnrelatedPictures)
{
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    for (int seed = 0; seed < 4; ++seed)
    {
      const ViewMatch match = matchPoints(test::texturedPicture(100 + seed), test::texturedPicture(200 + seed), model);
      EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << "seed " << seed << ": " << match.message;
      EXPECT_EQ(match.inliers, 0);
      EXPECT_TRUE(match.matrix.array().isNaN().all());
      EXPECT_TRUE(std::isnan(match.rms_error));
      for (const MatchedPoint& point : match.matches)
      {
        EXPECT_FALSE(point.inlier);
      }
    }
  }
}

TEST(SceneMatcher, FindsNothingInUnrelatedPictures)
{
  for (int seed = 1; seed <= 5; ++seed)
  {
    const ViewMatch result = matchScene(test::texturedPicture(seed), test::texturedPicture(seed + 50));
    EXPECT_EQ(result.outcome, MatchOutcome::NO_GEOMETRY) << seed << ": " << result.message;
    EXPECT_TRUE(result.matrix.hasNaN());
  }
}

}  // namespace view_servo
