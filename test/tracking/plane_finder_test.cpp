// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_finder.h"

#include "support/corner_error.h"

#include "support/textured_plane.h"

#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
const cv::Size VIEW_SIZE(480, 360);

/** The picture in half its size, at a place. */
Eigen::Matrix3d placed(double u, double v)
{
  Eigen::Matrix3d h;
  h << 0.48, 0.0, u, 0.0, 0.48, v, 0.0, 0.0, 1.0;
  return h;
}

class PlaneFinderTest : public ::testing::Test
{
protected:
  PlaneFinder::Answer find(const cv::Mat& image, const std::optional<Eigen::Matrix3d>& last_h = std::nullopt) const
  {
    return finder_.find({ view_, image, last_h });
  }

  static void expectAt(const Eigen::Matrix3d& h, const PlaneFinder::Answer& answer)
  {
    ASSERT_TRUE(answer.h) << answer.reason;
    EXPECT_LT(cornerError(*answer.h, h, VIEW_SIZE), 1.5);
    EXPECT_TRUE(answer.reason.empty()) << answer.reason;
    EXPECT_GE(answer.inliers.size(), 20u);
    for (const Correspondence& pair : answer.inliers)
    {
      EXPECT_LT((transfer(h, pair.reference) - pair.current).norm(), 6.0);
    }
  }

  static void expectNotFound(const std::string& words, const PlaneFinder::Answer& answer)
  {
    EXPECT_FALSE(answer.h);
    EXPECT_TRUE(answer.inliers.empty());
    EXPECT_NE(answer.reason.find(words), std::string::npos) << answer.reason;
    EXPECT_EQ(answer.reason.find('\n'), std::string::npos) << answer.reason;
  }

  /** The picture side by side with itself. */
  cv::Mat twice() const
  {
    cv::Mat both = warpedPicture(picture_, left_, VIEW_SIZE);
    warpedPicture(picture_, right_, VIEW_SIZE).colRange(246, 476).copyTo(both.colRange(246, 476));
    return both;
  }

  const Eigen::Matrix3d left_ = placed(4.0, 90.0);
  const Eigen::Matrix3d right_ = placed(246.0, 90.0);
  const cv::Mat picture_ = texturedPicture(1, VIEW_SIZE);
  const PlaneFinder finder_{ PointViewMatcherParams() };
  const std::shared_ptr<const PreparedImage> view_ =
      std::make_shared<const PreparedImage>(picture_, cv::Rect(), finder_.features());
};

TEST_F(PlaneFinderTest, FindsTheView)
{
  expectAt(exampleHomography(), find(warpedPicture(picture_, exampleHomography(), VIEW_SIZE)));
  expectAt(left_, find(warpedPicture(picture_, left_, VIEW_SIZE)));
}

TEST_F(PlaneFinderTest, FindsARegion)
{
  const cv::Rect region(120, 90, 240, 180);
  const auto view = std::make_shared<const PreparedImage>(picture_, region, finder_.features());
  const PlaneFinder::Answer answer =
      finder_.find({ view, warpedPicture(picture_, exampleHomography(), VIEW_SIZE), std::nullopt });
  expectAt(exampleHomography(), answer);
  for (const Correspondence& pair : answer.inliers)
  {
    EXPECT_TRUE(region.contains(cv::Point2d(pair.reference.x(), pair.reference.y())));
  }
}

TEST_F(PlaneFinderTest, FindsTheViewInAnImageOfAnotherSize)
{
  const cv::Size larger(600, 400);
  expectAt(exampleHomography(), find(warpedPicture(picture_, exampleHomography(), larger)));
}

TEST_F(PlaneFinderTest, SaysWhyAViewIsNotFound)
{
  expectNotFound("no geometry", find(texturedPicture(5, VIEW_SIZE)));
}

TEST_F(PlaneFinderTest, RefusesAViewThatIsSeenTwice)
{
  expectNotFound("seen in two places", find(twice()));
  expectNotFound("seen in two places", find(twice(), placed(125.0, 90.0)));
}

TEST_F(PlaneFinderTest, FindsTheOneOfTwoThatIsExpected)
{
  expectAt(left_, find(twice(), left_));
  expectAt(right_, find(twice(), right_));
  expectAt(right_, find(twice(), placed(230.0, 80.0)));
}

TEST_F(PlaneFinderTest, FindsTheViewElsewhereThanExpected)
{
  expectAt(right_, find(warpedPicture(picture_, right_, VIEW_SIZE), left_));
}

/** A last place that is none, as after an estimate at the horizon. */
TEST_F(PlaneFinderTest, DoesNotTrustALastPlaceWithoutSense)
{
  const cv::Mat image = warpedPicture(picture_, left_, VIEW_SIZE);
  expectAt(left_, find(image, Eigen::Matrix3d::Zero()));
  expectAt(left_, find(image, Eigen::Matrix3d::Constant(std::nan(""))));
  expectNotFound("seen in two places", find(twice(), Eigen::Matrix3d::Constant(std::nan(""))));
}

TEST_F(PlaneFinderTest, SaysWhatIsWrongWithAnImage)
{
  expectNotFound("the image is empty", find(cv::Mat()));
  expectNotFound("too few corners", find(cv::Mat(VIEW_SIZE, CV_8UC1, cv::Scalar(0))));
  EXPECT_THROW(find(cv::Mat(VIEW_SIZE, CV_8UC3, cv::Scalar(0))), std::invalid_argument);
}

TEST_F(PlaneFinderTest, CanBeGivenUp)
{
  const auto given_up = [] {
    return true;
  };
  expectNotFound("given up",
                 finder_.find({ view_, warpedPicture(picture_, left_, VIEW_SIZE), std::nullopt }, given_up));
}

TEST_F(PlaneFinderTest, SaysWhatIsWrongWithAView)
{
  const cv::Mat black(VIEW_SIZE, CV_8UC1, cv::Scalar(0));
  const auto view = std::make_shared<const PreparedImage>(black, cv::Rect(), finder_.features());
  expectNotFound("too few corners", finder_.find({ view, picture_, std::nullopt }));
  expectNotFound("too few corners", finder_.find({ view, black, std::nullopt }));
}

TEST_F(PlaneFinderTest, RefusesFaultyParameters)
{
  PointViewMatcherParams params;
  params.min_log_significance = -1.0;
  EXPECT_THROW(PlaneFinder{ params }, std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
