// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of everything between two images of a scene and its geometry. */
struct SceneMatcherParams
{
  PointViewMatcherParams points;
  LineMatcherParams lines;
  double inlier_threshold = 2.0;      ///< largest Sampson distance of a match that agrees [px]
  double plane_correlation = 0.75;    ///< least correlation of a corner's patch, warped by the homography of a plane
  double min_log_significance = 6.0;  ///< least -log10 of the false alarms of a fundamental matrix
  std::uint64_t seed = 1;             ///< fixes all random draws of this stage

  SceneMatcherParams();

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of the parameters of this stage alone, by which validate() checks them. */
std::vector<Parameter> sceneParameters(SceneMatcherParams& params);

/** The same with those of points and, as `line_...`, of lines: many names of the two are the same. */
std::vector<Parameter> parameters(SceneMatcherParams& params);

/**
 * Matches two views of a scene with depth by corners and line segments together: in rooms and before buildings the two
 * kinds fail on different pairs. Stateless between calls: the same input gives the same result.
 *
 * Steps: corners and segments are matched by PointViewMatcher and LineViewMatcher; each plane that either suggests is
 * believed only if corners look alike along its homography more often than beside it; all corners are sought along the
 * planes; corners, intersections of segments and candidates go into one estimation; a fundamental matrix has to stand
 * without its best plane (see Parallax), where it fails the answer is the homography of that plane.
 */
class SceneMatcher
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit SceneMatcher(const SceneMatcherParams& params);

  const SceneMatcherParams& params() const
  {
    return params_;
  }

  /** What both images must have been prepared with. */
  FeatureParams features() const;

  /**
   * In the result, `model` says what was found: FUNDAMENTAL, or HOMOGRAPHY where nothing off one plane tells more, and
   * `matrix` is that one. `matches` are corners and intersections, best first; `lines` the segments matched on planes
   * that agree; `planes` the homographies of these planes.
   * @param model HOMOGRAPHY: the plane that is confirmed best, also where there is more than one.
   * @param given_up asked now and then; once it is true, the match ends without a geometry.
   */
  ViewMatch match(const PreparedImage& reference, const PreparedImage& current,
                  GeometryModel model = GeometryModel::FUNDAMENTAL, const std::function<bool()>& given_up = {}) const;

private:
  SceneMatcherParams params_;
};

}  // namespace view_servo
