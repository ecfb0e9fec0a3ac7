// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "support/matched_views.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>

namespace view_servo
{
TEST(PointViewMatcher, FindsNothingInUnrelatedPictures)
{
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    for (int seed = 0; seed < 4; ++seed)
    {
      const ViewMatch match = test::matchPoints(PointViewMatcherParams(), test::texturedPicture(100 + seed),
                                                test::texturedPicture(200 + seed), model);
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
    const ViewMatch result = test::matchScene(test::texturedPicture(seed), test::texturedPicture(seed + 50));
    EXPECT_EQ(result.outcome, MatchOutcome::NO_GEOMETRY) << seed << ": " << result.message;
    EXPECT_TRUE(result.matrix.hasNaN());
  }
}

}  // namespace view_servo
