// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/line_segments.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/matching/line_regions.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <cstdint>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of the whole way from two images' segments to their geometry. */
struct LineMatcherParams
{
  LineSegmentParams segments;
  LineFeatureParams features;
  LineRegionParams regions;
  RansacParams ransac;           ///< of points and of lines; the inlier threshold is that of points [px]
  double plane_threshold = 2.0;  ///< of the lines of a plane, across, in either image [px], > 0
  int min_plane_lines = 8;       ///< lines that make a plane, >= 5
  int max_planes = 4;            ///< planes looked for, >= 1
  double min_quality = 0.5;      ///< mean of share and correlation of a match, [0, 1)
  std::uint64_t seed = 1;

  LineMatcherParams();

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/**
 * Matches the line segments of two views by the structure of their groups (thesis ch. 4), and what the image shows
 * beside them. Stateless between calls: the same input gives the same result.
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
   * Votes of groups, regions of segments that agree with a local homography, the regions that agree with one epipolar
   * geometry, planes, and what the planes predict. In the result, `lines` are the matched segments, with their indices
   * among those given to LineFeatures; `matches` the intersections of neighbouring ones; `planes` the homographies of
   * planes; `fundamental` that of the points or, where they do not determine it, of two planes. `matrix` is the first
   * plane's or the fundamental one. Both must have been prepared with params().features.
   */
  ViewMatch match(const LineFeatures& reference, const LineFeatures& current, GeometryModel model,
                  LineGrouping groups) const;

private:
  LineMatcherParams params_;
};

}  // namespace view_servo
