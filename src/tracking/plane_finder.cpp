// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_finder.h"

#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <array>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double RIVALRY = 0.5;  // a second place counts from this part of the first one's inliers

/** The corners of a rectangle of pixels, moved by a homography; NaN beyond the horizon. */
std::array<Eigen::Vector2d, 4> movedCorners(const cv::Rect& rect, const Eigen::Matrix3d& h)
{
  std::array<Eigen::Vector2d, 4> corners = cornersOf(rect);
  for (Eigen::Vector2d& corner : corners)
  {
    corner = transfer(h, corner);
  }
  return corners;
}

/** Whether two homographies show a region in different places: its middles are apart by half its size. */
bool isElsewhere(const cv::Rect& region, const Eigen::Matrix3d& h, const Eigen::Matrix3d& other)
{
  const Eigen::Vector2d middle = middleOf(region);
  const std::array<Eigen::Vector2d, 4> corners = movedCorners(region, h);
  const double size = 0.5 * ((corners[2] - corners[0]).norm() + (corners[3] - corners[1]).norm());
  return !((transfer(h, middle) - transfer(other, middle)).norm() < 0.25 * size);
}

/** The image with the region painted over where a homography shows it; corners beyond the horizon are left out. */
cv::Mat withoutRegion(const cv::Mat& grey, const cv::Rect& region, const Eigen::Matrix3d& h)
{
  constexpr double FARTHEST = 1e4;  // [px]
  std::vector<cv::Point> polygon;
  for (const Eigen::Vector2d& corner : movedCorners(region, h))
  {
    if (corner.allFinite())
    {
      const Eigen::Vector2d at = corner.cwiseMax(-FARTHEST).cwiseMin(FARTHEST);
      polygon.emplace_back(cvRound(at.x()), cvRound(at.y()));
    }
  }
  cv::Mat painted = grey.clone();
  if (!polygon.empty())
  {
    cv::Mat mask(grey.size(), CV_8UC1, cv::Scalar(0));
    cv::fillConvexPoly(mask, polygon, cv::Scalar(255));
    painted.setTo(cv::mean(grey, mask), mask);
  }
  return painted;
}

PlaneFinder::Answer toAnswer(const ViewMatch& match)
{
  PlaneFinder::Answer answer;
  answer.h = match.matrix;
  for (const MatchedPoint& point : match.matches)
  {
    if (point.inlier)
    {
      answer.inliers.push_back(point.position);
    }
  }
  return answer;
}

PlaneFinder::Answer notFound(std::string reason)
{
  PlaneFinder::Answer answer;
  answer.reason = std::move(reason);
  return answer;
}

/** Which of several places is meant, or that there are several, is told here. */
PointViewMatcherParams withoutUniqueness(PointViewMatcherParams params)
{
  params.unique = false;
  return params;
}

}  // namespace

PlaneFinder::PlaneFinder(const PointViewMatcherParams& params) : matcher_(withoutUniqueness(params))
{
}

ViewMatch PlaneFinder::match(const PreparedImage& view, const cv::Mat& image,
                             const std::function<bool()>& given_up) const
{
  return matcher_.match(view, PreparedImage(image, cv::Rect(), features()), GeometryModel::HOMOGRAPHY, 0.0, given_up);
}

PlaneFinder::Answer PlaneFinder::find(const Question& question, const std::function<bool()>& given_up) const
{
  const PreparedImage& view = *question.view;
  if (question.image.empty())
  {
    return notFound("the image is empty");
  }
  const ViewMatch first = match(view, question.image, given_up);
  if (first.outcome != MatchOutcome::MATCHED)
  {
    return notFound(first.message);
  }
  const auto is_expected = [&](const ViewMatch& found) {
    return question.last_h && !isElsewhere(view.region(), found.matrix, *question.last_h);
  };
  if (is_expected(first))
  {
    return toAnswer(first);
  }
  const ViewMatch second = match(view, withoutRegion(question.image, view.region(), first.matrix), given_up);
  if (given_up && given_up())
  {
    return notFound("given up");
  }
  const bool rivals = second.outcome == MatchOutcome::MATCHED && second.inliers >= RIVALRY * first.inliers &&
                      isElsewhere(view.region(), first.matrix, second.matrix);
  if (!rivals)
  {
    return toAnswer(first);
  }
  return is_expected(second) ? toAnswer(second) : notFound("the view is seen in two places");
}

}  // namespace view_servo
