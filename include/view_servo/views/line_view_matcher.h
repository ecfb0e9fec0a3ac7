// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/line_segments.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/matching/line_regions.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/line_planes.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <cstdint>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of everything between the line segments of two images and their geometry. */
struct LineMatcherParams
{
  LineSegmentParams segments;
  LineFeatureParams features;
  LineRegionParams regions;
  RansacParams ransac;  ///< for points and lines; its inlier threshold is used for points only [px]
  LinePlaneParams planes;
  double min_quality = 0.5;           ///< least MatchedLine::score of a match
  double min_log_significance = 6.0;  ///< least ViewMatch::log_significance of a geometry that is accepted
  bool unique = true;                 ///< refuse a geometry when another one, a shift off, fits nearly as well
  bool refuse_mirrored = true;        ///< for a PreparedImage: refuse a current one that shows the view better mirrored
  double min_log_parallax = 3.0;  ///< least Parallax::significance() of a fundamental matrix, off each of the planes
  std::uint64_t seed = 1;         ///< fixes all random draws

  LineMatcherParams();

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LineMatcherParams& params);

/**
 * Matches the line segments of two views by the structure of groups of neighbouring segments (thesis ch. 4) and by what
 * the images show beside the segments. Stateless between calls: the same input gives the same result.
 */
class LineViewMatcher
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit LineViewMatcher(const LineMatcherParams& params);

  const LineMatcherParams& params() const
  {
    return params_;
  }

  /**
   * In the result, `lines` are the matched segments, with their indices among those given to LineFeatures; `matches`
   * are the intersections of matched neighbours; `planes` the homographies of planes; `fundamental` comes from the
   * intersections or, where these do not determine it, from two planes. `matrix` is the homography of the first plane
   * or the fundamental matrix, as `model` says.
   *
   * Steps: groups vote for pairs of segments; from these grow regions of segments that agree with a local homography;
   * regions that contradict the epipolar geometry of all are dropped; planes are fitted to what remains. The answer is
   * accepted if segments are found where the regions send them more often than beside, in all directions of shift, and
   * a fundamental matrix only if it stands without any one plane. What is not accepted still has `lines`, `matches` and
   * `planes`, for those who can tell by other means.
   *
   * Both LineFeatures must have been made with params().features.
   */
  ViewMatch match(const LineFeatures& reference, const LineFeatures& current, GeometryModel model,
                  LineGrouping groups) const;

  /**
   * The same of images, which must have been prepared with params().segments and params().features. The times in the
   * result include the detection of segments, where an image did not have them yet.
   */
  ViewMatch match(const PreparedImage& reference, const PreparedImage& current,
                  GeometryModel model = GeometryModel::HOMOGRAPHY, LineGrouping groups = LineGrouping::TRIPLETS) const;

private:
  LineMatcherParams params_;
};

}  // namespace view_servo
