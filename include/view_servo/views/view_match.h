// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/line_segment.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Core>

#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
/** Which geometry relates two images; each of the matchers estimates either. */
enum class GeometryModel
{
  HOMOGRAPHY,  ///< x_cur ~ H x_ref, for planes
  FUNDAMENTAL  ///< x_curᵀ F x_ref = 0, for scenes with depth
};

/** What came of matching. */
enum class MatchOutcome
{
  MATCHED,           ///< a geometry was found
  TOO_FEW_FEATURES,  ///< an image has too few corners or segments to try
  NO_GEOMETRY        ///< no geometry was found, or the one found is not trusted
};

/** A candidate match of two points: corners (PointViewMatcher), intersections (LineViewMatcher), or both. */
struct MatchedPoint
{
  Correspondence position;  ///< pixels of the full images
  /**
   * Larger is better: for corners the weight of their association; for intersections the lower score of the two lines.
   */
  double score;
  bool inlier;  ///< agrees with the geometry that was found
};

/** The positions of all matches, in their order. */
inline Correspondences positionsOf(const std::vector<MatchedPoint>& matches)
{
  Correspondences pairs;
  pairs.reserve(matches.size());
  for (const MatchedPoint& match : matches)
  {
    pairs.push_back(match.position);
  }
  return pairs;
}

/** A line segment matched by LineViewMatcher. */
struct MatchedLine
{
  Segment reference;    ///< in pixels of the full reference image
  Segment current;      ///< in pixels of the full current image
  int reference_index;  ///< index of `reference` among the segments given to its image's LineFeatures
  int current_index;    ///< index of `current` among the segments given to its image's LineFeatures
  double score;         ///< quality: mean of common share and correlation, in [0, 1]
  int plane = -1;       ///< index into ViewMatch::planes; -1 = none
};

/** How long one stage of matching took. */
struct StageTime
{
  std::string name;  ///< of the stage
  double ms;         ///< [ms]
};

/** The result of matching a stored view (`reference`) with a live image (`current`), by points, lines or both. */
struct ViewMatch
{
  MatchOutcome outcome = MatchOutcome::NO_GEOMETRY;
  std::string message;                              ///< what was found, or why nothing was: one line, for people
  GeometryModel model = GeometryModel::HOMOGRAPHY;  ///< what `matrix` is
  /** NaN unless MATCHED; H with H(2,2) = 1 where possible, F with norm 1. */
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<MatchedPoint> matches;  ///< all candidates, best first
  int inliers = 0;  ///< number of points, or for LineViewMatcher's H of lines, that agree with `matrix`
  /**
   * Root mean square over the inliers of the transfer error in one image (H) or the Sampson distance (F) [px]; NaN:
   * none.
   */
  double rms_error = std::numeric_limits<double>::quiet_NaN();
  RansacStatistics ransac;        ///< of the attempt that succeeded, else of the last
  std::vector<StageTime> stages;  ///< in the order of their ends
  double elapsed_ms = 0.0;        ///< of the whole match [ms]

  /**
   * -log10 of the expected number of geometries this good among chance matches; for LineViewMatcher of the probability
   * that chance matches as many lines. Zero for a homography of SceneMatcher.
   */
  double log_significance = 0.0;

  /** @name Set by PointViewMatcher only; zero otherwise.
   * @{ */
  int reference_level = 0;  ///< level of the reference PreparedImage at which the geometry was found
  int current_level = 0;    ///< level of the current PreparedImage at which it was found
  /** @} */

  /** @name Set by LineViewMatcher and SceneMatcher; empty and NaN otherwise.
   * @{ */
  std::vector<MatchedLine> lines;       ///< best first
  std::vector<Eigen::Matrix3d> planes;  ///< homographies x_cur ~ H x_ref of planes, most lines first
  /** F of norm 1 [px], x_curᵀ F x_ref = 0, whichever GeometryModel was asked for; NaN when it cannot be estimated. */
  Eigen::Matrix3d fundamental = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  /** @} */
};

}  // namespace view_servo
