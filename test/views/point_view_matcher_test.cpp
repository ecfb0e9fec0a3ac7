// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/point_view_matcher.h"

#include "support/cameras.h"
#include "support/corner_error.h"
#include "support/matched_views.h"
#include "support/textured_plane.h"
#include "view_servo/geometry/fundamental.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

namespace
{
using view_servo::GeometryEstimator;
using view_servo::GeometryModel;
using view_servo::MatchedPoint;
using view_servo::MatchOutcome;
using view_servo::PointViewMatcher;
using view_servo::PointViewMatcherParams;
using view_servo::PreparedImage;
using view_servo::ViewConsistency;
using view_servo::ViewMatch;
using view_servo::test::blotchedPicture;
using view_servo::test::cornerError;
using view_servo::test::disturbed;
using view_servo::test::exampleHomography;
using view_servo::test::matchPoints;
using view_servo::test::texturedPicture;
using view_servo::test::warpedPicture;

const cv::Size SIZE(480, 360);

/** A plane seen from far to the side. */
Eigen::Matrix3d steepHomography()
{
  Eigen::Matrix3d steep;
  steep << 0.45, 0.02, 90.0, -0.1, 0.85, 40.0, -6e-4, 1e-4, 1.0;
  return steep;
}

/** The picture seen through `h`, which maps to pixels `over` times as small as those of the result. */
cv::Mat averaged(const cv::Mat& picture, const Eigen::Matrix3d& h, const cv::Size& size, double over)
{
  cv::Mat map;
  cv::eigen2cv(h, map);
  cv::Mat large;
  cv::warpPerspective(picture, large, map, cv::Size(cvRound(size.width * over), cvRound(size.height * over)),
                      cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(128));
  cv::Mat result;
  cv::resize(large, result, size, 0.0, 0.0, cv::INTER_AREA);
  return result;
}

/** Two planes meeting in the middle of the reference like the pages of an open book, seen by two cameras. */
struct Book
{
  Book()
  {
    const Eigen::Matrix3d k = view_servo::test::cameraMatrix(420.0, 420.0, 239.5, 179.5);
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(-0.25, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d translation(0.35, 0.05, 0.1);
    fundamental = view_servo::test::fundamentalOf(k, k, rotation, translation).normalized();

    reference = texturedPicture(21, SIZE);
    current = cv::Mat(SIZE, CV_8UC1, cv::Scalar(128));
    // Each page holds the line x = 0, z = 1.2 of the reference camera, its normal turned to one side.
    for (const int side : { -1, 1 })
    {
      const Eigen::Vector3d normal = Eigen::Vector3d(0.6 * side, 0.0, 1.0).normalized();
      const double distance = normal.z() * 1.2;
      const Eigen::Matrix3d h = k * (rotation + translation * normal.transpose() / distance) * k.inverse();
      const cv::Rect half(side < 0 ? 0 : SIZE.width / 2, 0, SIZE.width / 2, SIZE.height);
      cv::Mat mask = cv::Mat::zeros(SIZE, CV_8UC1);
      mask(half).setTo(255);
      cv::Mat seen_mask;
      cv::threshold(warpedMask(mask, h), seen_mask, 128, 255, cv::THRESH_BINARY);
      warpedPicture(reference, h, SIZE).copyTo(current, seen_mask);
    }
  }

  static cv::Mat warpedMask(const cv::Mat& mask, const Eigen::Matrix3d& h)
  {
    cv::Mat matrix;
    cv::eigen2cv(h, matrix);
    cv::Mat result;
    cv::warpPerspective(mask, result, matrix, mask.size());
    return result;
  }

  cv::Mat reference;
  cv::Mat current;
  Eigen::Matrix3d fundamental;
};

TEST(PointViewMatcher, FindsThePlaneToAFractionOfAPixel)
{
  const cv::Mat reference = texturedPicture(1);
  const cv::Mat current = disturbed(warpedPicture(reference, exampleHomography(), SIZE), 0.8, 10.0, 2.0);
  const ViewMatch match = matchPoints(PointViewMatcherParams(), reference, current);
  ASSERT_EQ(match.outcome, MatchOutcome::MATCHED) << match.message;
  EXPECT_LT(cornerError(match.matrix, exampleHomography(), SIZE), 0.3);
  EXPECT_EQ(match.matrix(2, 2), 1.0);
  EXPECT_LT(match.rms_error, 1.0);
  EXPECT_GT(match.log_significance, 50.0);
  int inliers = 0;
  for (const MatchedPoint& point : match.matches)
  {
    if (point.inlier)
    {
      ++inliers;
      const Eigen::Vector2d predicted = (exampleHomography() * point.position.reference.homogeneous()).hnormalized();
      EXPECT_LT((predicted - point.position.current).norm(), 4.0);
    }
  }
  EXPECT_EQ(inliers, match.inliers);
  EXPECT_GT(inliers, 150);
}

TEST(PointViewMatcher, GuidedMatchingFindsMore)
{
  const cv::Mat reference = blotchedPicture(2, 2.0);
  const Eigen::Matrix3d steep = steepHomography();
  const cv::Mat current = disturbed(warpedPicture(reference, steep, SIZE), 0.7, 10.0, 4.0);
  PointViewMatcherParams params;
  const ViewMatch guided = matchPoints(params, reference, current);
  params.guided = false;
  const ViewMatch plain = matchPoints(params, reference, current);
  ASSERT_EQ(plain.outcome, MatchOutcome::MATCHED);
  EXPECT_GT(guided.inliers, plain.inliers * 13 / 10);
  EXPECT_LT(cornerError(guided.matrix, steep, SIZE), cornerError(plain.matrix, steep, SIZE));
}

TEST(PointViewMatcher, FindsEpipolarGeometryOfASceneWithDepth)
{
  const Book book;
  for (const ViewConsistency consistency : { ViewConsistency::OFF, ViewConsistency::BEFORE, ViewConsistency::WITHIN })
  {
    PointViewMatcherParams params;
    params.view_consistency = consistency;
    const ViewMatch match = matchPoints(params, book.reference, book.current, GeometryModel::FUNDAMENTAL);
    ASSERT_EQ(match.outcome, MatchOutcome::MATCHED) << match.message;
    EXPECT_GT(match.inliers, 80);
    EXPECT_NEAR(match.matrix.norm(), 1.0, 1e-9);
    EXPECT_NEAR(match.matrix.determinant(), 0.0, 1e-9);
    int right = 0;
    for (const MatchedPoint& point : match.matches)
    {
      right += point.inlier && view_servo::sampsonError(book.fundamental, point.position) < 4.0 ? 1 : 0;
    }
    EXPECT_GT(right, match.inliers * 8 / 10);
  }
}

TEST(PointViewMatcher, APlaneLeavesTheFundamentalMatrixOpen)
{
  for (const int corners : { 250, 500, 1000 })
  {
    PointViewMatcherParams params;
    params.points.corners.max_corners = corners;
    const cv::Mat reference = texturedPicture(1);
    const cv::Mat current = disturbed(warpedPicture(reference, exampleHomography(), SIZE), 0.8, 10.0, 2.0);
    const ViewMatch match = matchPoints(params, reference, current, GeometryModel::FUNDAMENTAL);
    EXPECT_EQ(match.outcome, MatchOutcome::NO_GEOMETRY) << corners << " corners: " << match.message;
    EXPECT_NE(match.message.find("look for a homography"), std::string::npos) << match.message;
  }
}

TEST(PointViewMatcher, SeveralHypothesesFindTheSameGeometryFromMoreMatches)
{
  const cv::Mat reference = blotchedPicture(2, 2.0);
  const cv::Mat current = disturbed(warpedPicture(reference, steepHomography(), SIZE), 0.7, 10.0, 4.0);
  const Book book;
  PointViewMatcherParams params;
  params.guided = false;
  const ViewMatch plane = matchPoints(params, reference, current);
  const ViewMatch pages = matchPoints(params, book.reference, book.current, GeometryModel::FUNDAMENTAL);
  ASSERT_EQ(plane.outcome, MatchOutcome::MATCHED);
  ASSERT_EQ(pages.outcome, MatchOutcome::MATCHED);
  for (const GeometryEstimator estimator : { GeometryEstimator::MULTI_HYPOTHESIS, GeometryEstimator::IMPORTANCE })
  {
    params.estimator = estimator;
    params.ransac.max_iterations = estimator == GeometryEstimator::IMPORTANCE ? 20000 : 2000;
    const ViewMatch several = matchPoints(params, reference, current);
    ASSERT_EQ(several.outcome, MatchOutcome::MATCHED) << several.message;
    EXPECT_LT(cornerError(several.matrix, steepHomography(), SIZE), 3.0);
    EXPECT_GT(several.inliers, plane.inliers);
    const ViewMatch of_pages = matchPoints(params, book.reference, book.current, GeometryModel::FUNDAMENTAL);
    ASSERT_EQ(of_pages.outcome, MatchOutcome::MATCHED) << of_pages.message;
    EXPECT_GE(of_pages.inliers, pages.inliers);
    std::set<std::pair<double, double>> used;
    for (const MatchedPoint& point : of_pages.matches)
    {
      if (point.inlier)
      {
        EXPECT_TRUE(used.insert({ point.position.current.x(), point.position.current.y() }).second);
      }
    }
  }
}

TEST(PointViewMatcherParams, FilteringCandidatesNeedsAnEstimatorThatKeepsToThem)
{
  PointViewMatcherParams params;
  params.view_consistency = ViewConsistency::BEFORE;
  EXPECT_TRUE(params.validate().empty());
  params.estimator = GeometryEstimator::MULTI_HYPOTHESIS;
  EXPECT_EQ(params.validate().size(), 1U);
}

TEST(PointViewMatcher, WorksWithUniformSamplingAndWithoutLocalOptimisation)
{
  const cv::Mat reference = texturedPicture(3);
  const cv::Mat current = warpedPicture(reference, exampleHomography(), SIZE);
  PointViewMatcherParams params;
  params.ransac.sampling = view_servo::Sampling::UNIFORM;
  params.ransac.local_optimizations = 0;
  params.ransac.improvement_stage = true;
  const ViewMatch match = matchPoints(params, reference, current);
  ASSERT_EQ(match.outcome, MatchOutcome::MATCHED);
  EXPECT_LT(cornerError(match.matrix, exampleHomography(), SIZE), 0.5);
}

TEST(PointViewMatcher, FindsAViewThatIsMuchSmallerOrLarger)
{
  const cv::Mat reference = blotchedPicture(4, 1.5, cv::Size(800, 600));
  Eigen::Matrix3d shrink = Eigen::Matrix3d::Identity();
  shrink.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(0.3).toRotationMatrix() / 3.2;
  shrink(0, 2) = 300.0;
  shrink(1, 2) = 200.0;
  cv::Mat blurred;
  cv::GaussianBlur(reference, blurred, cv::Size(), 1.4);  // what the smaller image cannot show
  const cv::Mat current = warpedPicture(blurred, shrink, reference.size());

  PointViewMatcherParams params;
  const ViewMatch smaller = matchPoints(params, reference, current);
  ASSERT_EQ(smaller.outcome, MatchOutcome::MATCHED) << smaller.message;
  EXPECT_GT(smaller.reference_level, smaller.current_level);
  EXPECT_LT(cornerError(smaller.matrix, shrink, reference.size()), 2.0);

  const ViewMatch larger = matchPoints(params, current, reference);
  ASSERT_EQ(larger.outcome, MatchOutcome::MATCHED) << larger.message;
  EXPECT_LT(larger.reference_level, larger.current_level);
  EXPECT_LT(cornerError(larger.matrix.inverse(), shrink, reference.size()), 2.0);

  params.scale_search = false;
  EXPECT_EQ(matchPoints(params, reference, current).outcome, MatchOutcome::NO_GEOMETRY);
}

TEST(PointViewMatcher, FindsAPlaneThatIsSeenVeryObliquely)
{
  // Like bench_points' planes: the picture fills the reference and turns about an axis through its centre.
  constexpr double TILT = 85.0;  // [degrees]
  const cv::Size size(768, 576);
  Eigen::Matrix3d k;
  k << 800.0, 0.0, 383.5, 0.0, 800.0, 287.5, 0.0, 0.0, 1.0;
  const Eigen::Vector3d axis(std::sin(0.2), std::cos(0.2), 0.0);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(TILT * M_PI / 180.0, axis).toRotationMatrix();
  const Eigen::Vector3d centre = Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d h = k * (turn + (centre - turn * centre) * centre.transpose()) * k.inverse();

  // Drawn larger and averaged, as what is compressed so much would show false patterns else.
  constexpr double OVER = 4.0;
  Eigen::Matrix3d enlarge = Eigen::Vector3d(OVER, OVER, 1.0).asDiagonal();
  enlarge(0, 2) = enlarge(1, 2) = 0.5 * (OVER - 1.0);
  const cv::Mat reference = texturedPicture(31, size);
  const cv::Mat current = disturbed(averaged(reference, enlarge * h, size, OVER), 0.8, 10.0, 2.0);

  PointViewMatcherParams params;
  const ViewMatch found = matchPoints(params, reference, current);
  ASSERT_EQ(found.outcome, MatchOutcome::MATCHED) << found.message;
  EXPECT_GE(found.reference_level, PreparedImage::SCALES);
  EXPECT_LT(cornerError(found.matrix, h, size), 5.0);
  params.side_search = false;
  EXPECT_NE(matchPoints(params, reference, current).outcome, MatchOutcome::MATCHED);
}

TEST(PointViewMatcher, SaysWhenThereIsNothingToMatch)
{
  const cv::Mat flat(SIZE, CV_8UC1, cv::Scalar(90));
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    const ViewMatch match = matchPoints(PointViewMatcherParams(), texturedPicture(1), flat, model);
    EXPECT_EQ(match.outcome, MatchOutcome::TOO_FEW_FEATURES);
    EXPECT_NE(match.message.find("0 in the current image"), std::string::npos) << match.message;
    EXPECT_NE(match.message.find("the current image is nearly the same everywhere"), std::string::npos)
        << match.message;
    EXPECT_TRUE(match.matches.empty());
  }
}

TEST(PointViewMatcher, TakesImagesOfDifferentSizes)
{
  const cv::Mat reference = texturedPicture(5);
  const cv::Size wide(620, 300);
  const ViewMatch match =
      matchPoints(PointViewMatcherParams(), reference, warpedPicture(reference, exampleHomography(), wide));
  ASSERT_EQ(match.outcome, MatchOutcome::MATCHED);
  EXPECT_LT(cornerError(match.matrix, exampleHomography(), SIZE), 0.5);
}

TEST(PointViewMatcher, LooksOnlyInTheRegionOfInterest)
{
  const cv::Mat reference = texturedPicture(6);
  const cv::Rect region(120, 60, 260, 240);
  const ViewMatch match =
      matchPoints(PointViewMatcherParams(), reference, warpedPicture(reference, exampleHomography(), SIZE),
                  GeometryModel::HOMOGRAPHY, region);
  ASSERT_EQ(match.outcome, MatchOutcome::MATCHED);
  for (const MatchedPoint& point : match.matches)
  {
    EXPECT_TRUE(region.contains(cv::Point2d(point.position.reference.x(), point.position.reference.y())));
  }
}

TEST(PointViewMatcher, GivesTheSameResultEveryTime)
{
  const cv::Mat reference = texturedPicture(7);
  const cv::Mat current = disturbed(warpedPicture(reference, exampleHomography(), SIZE), 0.9, 5.0, 3.0);
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const ViewMatch one = matchPoints(PointViewMatcherParams(), reference, current);
  cv::setNumThreads(3);
  const ViewMatch three = matchPoints(PointViewMatcherParams(), reference, current);
  cv::setNumThreads(threads);
  EXPECT_EQ(one.matrix, three.matrix);
  ASSERT_EQ(one.matches.size(), three.matches.size());
  for (std::size_t i = 0; i < one.matches.size(); ++i)
  {
    EXPECT_EQ(one.matches[i].position.current, three.matches[i].position.current);
  }
}

TEST(PointViewMatcher, TakesTheThresholdOfTheCall)
{
  const cv::Mat reference = texturedPicture(8);
  const cv::Mat current = disturbed(warpedPicture(reference, exampleHomography(), SIZE), 1.0, 0.0, 3.0);
  const PointViewMatcher matcher{ PointViewMatcherParams() };
  const PreparedImage a(reference, cv::Rect(), matcher.params().points);
  const PreparedImage b(current, cv::Rect(), matcher.params().points);
  const ViewMatch tight = matcher.match(a, b, GeometryModel::HOMOGRAPHY, 0.5);
  const ViewMatch wide = matcher.match(a, b, GeometryModel::HOMOGRAPHY, 4.0);
  ASSERT_EQ(tight.outcome, MatchOutcome::MATCHED);
  EXPECT_LT(tight.rms_error, 0.5);
  EXPECT_LT(tight.inliers, wide.inliers);
  EXPECT_THROW(matcher.match(a, b, GeometryModel::HOMOGRAPHY, -1.0), std::invalid_argument);
  EXPECT_THROW(matcher.match(a, b, GeometryModel::HOMOGRAPHY, std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

TEST(PointViewMatcherParams, NameTheFaultsOfAllPartsAtOnce)
{
  EXPECT_TRUE(PointViewMatcherParams().validate().empty());
  PointViewMatcherParams params;
  params.points.corners.max_corners = 0;
  params.ransac.max_iterations = 0;
  params.consistency.threshold = 0.0;
  params.guidance.patch_radius = 0;
  params.min_log_significance = -1.0;
  params.first_share = 0.0;
  EXPECT_EQ(params.validate().size(), 6U);
  EXPECT_THROW(PointViewMatcher{ params }, std::invalid_argument);
}

}  // namespace
