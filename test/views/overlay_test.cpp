// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/overlay.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <limits>

using view_servo::drawOverlay;
using view_servo::GeometryModel;
using view_servo::MatchedLine;
using view_servo::MatchOutcome;
using view_servo::PreparedImage;
using view_servo::Segment;
using view_servo::ViewMatch;

namespace
{
/** Grey, so that all colour in a picture was drawn. */
PreparedImage image(int width, int height, const cv::Rect& region = cv::Rect())
{
  return PreparedImage(cv::Mat(height, width, CV_8UC1, cv::Scalar(100)), region, {});
}

/** Widths of 450 + 450 pixels are not scaled; the current image starts here. */
constexpr int CURRENT_LEFT = 454;

ViewMatch noMatch()
{
  ViewMatch match;
  match.matrix.setConstant(std::numeric_limits<double>::quiet_NaN());
  match.message = "nothing";
  return match;
}

ViewMatch matchOf(const Eigen::Matrix3d& h)
{
  ViewMatch match;
  match.outcome = MatchOutcome::MATCHED;
  match.message = "something";
  match.matrix = h;
  return match;
}

Eigen::Matrix3d shift(double u, double v)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(0, 2) = u;
  h(1, 2) = v;
  return h;
}

MatchedLine line(const Segment& reference, const Segment& current, int plane = 0)
{
  return { reference, current, 0, 0, 0.8, plane };
}

/** Pixels of an area that are not grey. */
int colouredPixels(const cv::Mat& picture, const cv::Rect& area)
{
  int count = 0;
  for (int y = area.y; y < area.y + area.height; ++y)
  {
    for (int x = area.x; x < area.x + area.width; ++x)
    {
      const cv::Vec3b pixel = picture.at<cv::Vec3b>(y, x);
      count += pixel[0] != pixel[1] || pixel[1] != pixel[2] ? 1 : 0;
    }
  }
  return count;
}

cv::Rect around(double x, double y, int radius = 2)
{
  return { cvRound(x) - radius, cvRound(y) - radius, 2 * radius + 1, 2 * radius + 1 };
}

}  // namespace

TEST(Overlay, ShowsBothImagesWithoutScalingWhenTheyFit)
{
  const cv::Mat picture = drawOverlay(image(450, 300), image(450, 200), noMatch());
  EXPECT_EQ(picture.type(), CV_8UC3);
  EXPECT_EQ(picture.cols, CURRENT_LEFT + 450);
  EXPECT_GT(picture.rows, 300);
  EXPECT_EQ(picture.at<cv::Vec3b>(299, 449), cv::Vec3b(100, 100, 100));
  EXPECT_EQ(picture.at<cv::Vec3b>(199, CURRENT_LEFT), cv::Vec3b(100, 100, 100));
  EXPECT_NE(picture.at<cv::Vec3b>(201, CURRENT_LEFT), cv::Vec3b(100, 100, 100));
}

TEST(Overlay, KeepsAReadableWidth)
{
  for (const int width : { 16, 100, 1000, 4000 })
  {
    const cv::Mat picture = drawOverlay(image(width, 60), image(64, width), noMatch());
    EXPECT_GE(picture.cols, 800);
    EXPECT_LE(picture.cols, 1610);
  }
}

TEST(Overlay, JoinsInliersOnly)
{
  ViewMatch match = noMatch();
  match.matches.push_back({ { { 100.0, 50.0 }, { 300.0, 50.0 } }, 1.0, true });
  match.matches.push_back({ { { 100.0, 150.0 }, { 300.0, 150.0 } }, 1.0, false });
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);

  EXPECT_GT(colouredPixels(picture, around(100, 50)), 5);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 300, 50)), 5);
  EXPECT_GT(colouredPixels(picture, around(250, 50)), 2) << "the line between them";

  EXPECT_NE(picture.at<cv::Vec3b>(150, 100), cv::Vec3b(100, 100, 100)) << "a candidate's dot";
  EXPECT_NE(picture.at<cv::Vec3b>(150, CURRENT_LEFT + 300), cv::Vec3b(100, 100, 100));
  EXPECT_EQ(picture.at<cv::Vec3b>(150, 250), cv::Vec3b(100, 100, 100));
}

TEST(Overlay, ColoursTellPlacesApart)
{
  ViewMatch match = noMatch();
  match.matches.push_back({ { { 20.0, 50.0 }, { 20.0, 50.0 } }, 1.0, true });
  match.matches.push_back({ { { 430.0, 100.0 }, { 430.0, 100.0 } }, 1.0, true });
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_GT(cv::norm(picture.at<cv::Vec3b>(50, 20), picture.at<cv::Vec3b>(100, 430)), 100.0);
}

TEST(Overlay, DrawsTheReferencesOutlineInBothImages)
{
  const cv::Rect region(50, 40, 100, 80);
  const cv::Mat picture = drawOverlay(image(450, 200, region), image(450, 200), matchOf(shift(30.0, 20.0)));
  EXPECT_GT(colouredPixels(picture, around(100, 39.5)), 5);
  EXPECT_GT(colouredPixels(picture, around(149.5, 80)), 5);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 130, 59.5)), 5);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 79.5, 100)), 5);
  EXPECT_EQ(colouredPixels(picture, around(100, 80, 20)), 0);
}

TEST(Overlay, DrawsNoOutlineForFundamentalMatrices)
{
  ViewMatch match = matchOf(Eigen::Matrix3d::Identity());
  match.model = GeometryModel::FUNDAMENTAL;
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_EQ(colouredPixels(picture, { 0, 0, picture.cols, 200 }), 0);
}

TEST(Overlay, ClipsTheOutlineToTheCurrentImage)
{
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 150), matchOf(shift(-100.0, 20.0)));
  // Nothing of the current image's outline may reach into the reference or below its own image.
  EXPECT_EQ(colouredPixels(picture, { 20, 20, 400, 160 }), 0);
  EXPECT_EQ(colouredPixels(picture, { CURRENT_LEFT, 150, 450, picture.rows - 150 }), 0);
}

TEST(Overlay, DrawsWhatIsInFrontWhenThePlaneReachesTheHorizon)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h(2, 0) = -1.0 / 300.0;  // columns from 300 on are behind the camera
  ViewMatch match = matchOf(h);
  match.matches.push_back({ { { 50.0, 50.0 }, { 60.0, 60.0 } }, 1.0, true });
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 1, 100)), 3) << "the left side is in front";
  const cv::Mat same = drawOverlay(image(450, 200), image(450, 200), [&] {
    match.matrix = -h;
    return match;
  }());
  EXPECT_EQ(cv::norm(picture, same, cv::NORM_INF), 0.0) << "a homography has no sign";
}

TEST(Overlay, SaysWhatHappened)
{
  const auto caption = [](const cv::Mat& picture) {
    return picture.rowRange(200, picture.rows).clone();
  };
  ViewMatch match = noMatch();
  const cv::Mat first = caption(drawOverlay(image(450, 200), image(450, 200), match));
  match.message = "something else that is very, very long: " + std::string(300, 'x');
  const cv::Mat second = caption(drawOverlay(image(450, 200), image(450, 200), match));
  EXPECT_GT(cv::norm(first, second, cv::NORM_INF), 50.0);
  EXPECT_EQ(cv::norm(second.colRange(second.cols - 4, second.cols), cv::NORM_INF),
            cv::norm(second.colRange(0, 4), cv::NORM_INF))
      << "it fits";
}

TEST(Overlay, DrawsBothSegmentsOfAPairInOneColour)
{
  ViewMatch match = noMatch();
  match.lines.push_back(line({ { 50.0, 50.0 }, { 150.0, 50.0 } }, { { 300.0, 60.0 }, { 300.0, 160.0 } }));
  match.lines.push_back(line({ { 50.0, 150.0 }, { 150.0, 150.0 } }, { { 200.0, 60.0 }, { 200.0, 160.0 } }));
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  const auto colour = [&](int x, int y) {
    return picture.at<cv::Vec3b>(y, x);
  };
  EXPECT_GT(colouredPixels(picture, around(70, 50)), 5);
  EXPECT_EQ(colour(70, 50), colour(CURRENT_LEFT + 300, 80));
  EXPECT_EQ(colour(70, 150), colour(CURRENT_LEFT + 200, 80));
  EXPECT_GT(cv::norm(colour(70, 50), colour(70, 150)), 100.0);
}

TEST(Overlay, DimsTheImagesUnderSegmentsOnly)
{
  ViewMatch match = noMatch();
  match.lines.push_back(line({ { 50.0, 50.0 }, { 150.0, 50.0 } }, { { 300.0, 60.0 }, { 300.0, 160.0 } }));
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_LT(picture.at<cv::Vec3b>(150, 400)[0], 90);
  EXPECT_LT(picture.at<cv::Vec3b>(150, CURRENT_LEFT + 50)[0], 90);
}

TEST(Overlay, NumbersSegmentsUnlessTheyAreMany)
{
  // The same picture but for what stands beside one segment.
  const auto pixels_beside = [](std::size_t count) {
    ViewMatch match = noMatch();
    match.lines.assign(count, line({ { 50.0, 50.0 }, { 150.0, 50.0 } }, { { 50.0, 50.0 }, { 150.0, 50.0 } }));
    const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
    return colouredPixels(picture, { 50, 54, 100, 20 });
  };
  EXPECT_GT(pixels_beside(1), 5);
  EXPECT_GT(pixels_beside(60), 5);
  EXPECT_EQ(pixels_beside(61), 0);
}

TEST(Overlay, TellsPlanesApart)
{
  const auto drawn = [](int plane) {
    ViewMatch match = noMatch();
    match.lines.push_back(line({ { 50.0, 50.0 }, { 150.0, 50.0 } }, { { 50.0, 50.0 }, { 150.0, 50.0 } }, plane));
    return drawOverlay(image(450, 200), image(450, 200), match);
  };
  const cv::Mat none = drawn(-1);
  const cv::Mat first = drawn(0);
  const cv::Mat second = drawn(1);
  const cv::Mat third = drawn(2);
  EXPECT_GT(cv::norm(none, first, cv::NORM_INF), 50.0);
  EXPECT_GT(cv::norm(first, second, cv::NORM_INF), 50.0);
  EXPECT_GT(cv::norm(second, third, cv::NORM_INF), 50.0);
}

TEST(Overlay, MarksIntersections)
{
  ViewMatch match = noMatch();
  match.lines.push_back(line({ { 50.0, 50.0 }, { 150.0, 50.0 } }, { { 300.0, 60.0 }, { 300.0, 160.0 } }));
  match.matches.push_back({ { { 200.0, 100.0 }, { 150.0, 120.0 } }, 1.0, true });
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_GT(colouredPixels(picture, around(200, 100)), 3);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 150, 120)), 3);
  EXPECT_EQ(colouredPixels(picture, around(400, 110)), 0) << "they are not joined";
}

TEST(Overlay, ClipsSegmentsToTheirImages)
{
  ViewMatch match = noMatch();
  match.lines.push_back(line({ { 400.0, 50.0 }, { 1e6, 50.0 } }, { { -1e6, 100.0 }, { 50.0, 100.0 } }));
  match.lines.push_back(line({ { -500.0, -500.0 }, { -400.0, -1e6 } }, { { 900.0, 100.0 }, { 1000.0, 900.0 } }));
  match.matches.push_back({ { { 470.0, 150.0 }, { -20.0, 150.0 } }, 1.0, true });
  const cv::Mat picture = drawOverlay(image(450, 200), image(450, 200), match);
  EXPECT_GT(colouredPixels(picture, around(430, 50)), 5);
  EXPECT_GT(colouredPixels(picture, around(CURRENT_LEFT + 20, 100)), 5);
  EXPECT_EQ(colouredPixels(picture, { CURRENT_LEFT, 0, 450, 80 }), 0);
  EXPECT_EQ(colouredPixels(picture, { 0, 80, 450, picture.rows - 80 }), 0);
}

TEST(Overlay, DrawsTheOutlineWhenLinesHaveOnePlane)
{
  const cv::Rect region(50, 40, 100, 80);
  ViewMatch match = matchOf(shift(30.0, 20.0));
  match.lines.push_back(line({ { 300.0, 50.0 }, { 350.0, 50.0 } }, { { 330.0, 70.0 }, { 380.0, 70.0 } }));
  for (const std::size_t planes : { 1, 2 })
  {
    match.planes.assign(planes, match.matrix);
    const cv::Mat picture = drawOverlay(image(450, 200, region), image(450, 200), match);
    const bool drawn = colouredPixels(picture, around(CURRENT_LEFT + 130, 59.5)) > 5;
    EXPECT_EQ(drawn, planes == 1);
  }
}

TEST(FollowedView, ShowsOutlinePointsAndText)
{
  const cv::Mat current(200, 450, CV_8UC1, cv::Scalar(100));
  view_servo::FollowedView view;
  view.region = cv::Rect(40, 30, 61, 61);
  view.h = shift(100.0, 20.0);
  view.found = { { 60.0, 60.0 } };
  view.missing = { { 80.0, 60.0 } };
  view.text = "goal: tracking";
  const cv::Mat picture = view_servo::drawFollowedView(current, view);
  EXPECT_EQ(picture.cols, 450);
  EXPECT_GT(picture.rows, 200);
  EXPECT_GT(colouredPixels(picture, around(140, 80)), 5);  // the left side of the outline
  const auto found = picture.at<cv::Vec3b>(80, 160);
  const auto missing = picture.at<cv::Vec3b>(80, 180);
  EXPECT_GT(found[1], found[2]);
  EXPECT_GT(missing[2], missing[1]);

  view.path = { { 300.0, 150.0 }, { 340.0, 150.0 } };
  EXPECT_GT(colouredPixels(view_servo::drawFollowedView(current, view), around(320, 150)), 3);
  view.path.clear();

  view.h.setConstant(std::numeric_limits<double>::quiet_NaN());
  const cv::Mat lost = view_servo::drawFollowedView(current, view);
  EXPECT_EQ(colouredPixels(lost, cv::Rect(0, 0, 450, 200)), 0);
}
