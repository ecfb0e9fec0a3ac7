// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"

#include <opencv2/core.hpp>

namespace view_servo
{
namespace test
{
/** @file Matches of two 8-bit images by each of the matchers. */

/** @param region of interest of the reference; empty: all of it. */
inline ViewMatch matchPoints(const PointViewMatcherParams& params, const cv::Mat& reference, const cv::Mat& current,
                             GeometryModel model = GeometryModel::HOMOGRAPHY, const cv::Rect& region = cv::Rect())
{
  return PointViewMatcher(params).match(PreparedImage(reference, region, params.points),
                                        PreparedImage(current, cv::Rect(), params.points), model);
}

inline ViewMatch matchScene(const cv::Mat& reference, const cv::Mat& current)
{
  const SceneMatcher matcher{ SceneMatcherParams() };
  return matcher.match(PreparedImage(reference, cv::Rect(), matcher.features()),
                       PreparedImage(current, cv::Rect(), matcher.features()));
}

/** What each matcher says of two images. */
struct MatchesOfAll
{
  ViewMatch points;
  ViewMatch points_with_depth;  ///< by a fundamental matrix
  ViewMatch lines;
  ViewMatch scene;
};

inline MatchesOfAll matchByAll(const SceneMatcherParams& params, const cv::Mat& reference_image,
                               const cv::Mat& current_image)
{
  const SceneMatcher scene(params);
  const PreparedImage reference(reference_image, cv::Rect(), scene.features());
  const PreparedImage current(current_image, cv::Rect(), scene.features());
  const PointViewMatcher points(params.points);
  return { points.match(reference, current, GeometryModel::HOMOGRAPHY),
           points.match(reference, current, GeometryModel::FUNDAMENTAL),
           LineViewMatcher(params.lines).match(reference, current), scene.match(reference, current) };
}

}  // namespace test
}  // namespace view_servo
