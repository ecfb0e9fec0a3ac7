// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/line_segment.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/multi_hypothesis.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/view_consistency.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
enum class GeometryModel
{
  HOMOGRAPHY,  ///< x_cur ~ H x_ref, for planes
  FUNDAMENTAL  ///< x_curᵀ F x_ref = 0, for scenes with depth
};

/** Where the constraint on five points is used (thesis 6.3); it has no meaning for homographies within RANSAC. */
enum class ViewConsistency
{
  OFF,
  BEFORE,  ///< method 1: candidates are filtered; for GeometryEstimator::RANSAC
  WITHIN   ///< method 2: samples are tested
};

/** How a geometry is found in an association (thesis ch. 9). */
enum class GeometryEstimator
{
  RANSAC,            ///< one candidate a point
  MULTI_HYPOTHESIS,  ///< samples from the candidates, support from all associations: the modified algorithm (9.5.1)
  IMPORTANCE         ///< samples and support from all associations: Algorithm 2, which takes many iterations
};

/** Options of the whole way from two images to their geometry. */
struct PointViewMatcherParams
{
  PointMatcherParams points;
  RansacParams ransac;
  GeometryEstimator estimator = GeometryEstimator::RANSAC;
  MultiHypothesisParams hypotheses;  ///< `sampling` is chosen by `estimator`
  ViewConsistency view_consistency = ViewConsistency::WITHIN;
  ViewConsistencyParams consistency;
  bool guided = true;  ///< look for more matches along the geometry found
  GuidedParams guidance;
  double first_share =
      0.6;  ///< part of the profiles that is searched for first; all, unless that leaves no doubt, (0, 1]
  bool scale_search = true;           ///< try other scale ratios and coarser scales when the first finds no geometry
  double min_log_significance = 6.0;  ///< -log10 of the number of false alarms that a geometry may have at most, >= 0
  std::uint64_t seed = 1;

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PointViewMatcherParams& params);

enum class MatchOutcome
{
  MATCHED,
  TOO_FEW_FEATURES,
  NO_GEOMETRY
};

struct MatchedPoint
{
  Correspondence position;  ///< pixels of the full images
  double score;             ///< association weight; larger is better
  bool inlier;
};

/** A line segment matched by LineViewMatcher. */
struct MatchedLine
{
  Segment reference;  ///< pixels of the full images
  Segment current;
  int reference_index;  ///< among the segments of the image
  int current_index;
  double score;    ///< mean of common share and correlation, in [0, 1]
  int plane = -1;  ///< index among the planes; -1 = none
};

struct StageTime
{
  std::string name;
  double ms;
};

/** What matching two images says: the one result type of image pairs. */
struct ViewMatch
{
  MatchOutcome outcome = MatchOutcome::NO_GEOMETRY;
  std::string message;  ///< one line, for people
  GeometryModel model = GeometryModel::HOMOGRAPHY;
  Eigen::Matrix3d matrix;             ///< NaN unless MATCHED; H with H(2,2) = 1 where possible, F with norm 1
  std::vector<MatchedPoint> matches;  ///< all candidates, best first
  int inliers = 0;
  double rms_error = 0.0;  ///< of the inliers: transfer error in one image (H) or Sampson distance (F) [px]; NaN: none
  std::vector<MatchedLine> lines;       ///< of LineViewMatcher, best first
  std::vector<Eigen::Matrix3d> planes;  ///< homographies of planes, of LineViewMatcher, most lines first
  /** Of LineViewMatcher; NaN when not estimable. */
  Eigen::Matrix3d fundamental = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  double log_significance = 0.0;  ///< -log10 of the expected number of geometries this good among chance matches
  int reference_level = 0;        ///< of PreparedImage, where the geometry was found
  int current_level = 0;
  RansacStatistics ransac;  ///< of the attempt that succeeded, else of the last
  std::vector<StageTime> stages;
  double elapsed_ms = 0.0;
};

/** Matches two views of a scene by intensity profiles. Stateless between calls: the same input gives the same result. */
class PointViewMatcher
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit PointViewMatcher(const PointViewMatcherParams& params);

  const PointViewMatcherParams& params() const
  {
    return params_;
  }

  /**
   * Both images must have been prepared with params().points.
   * @param inlier_threshold [px], 0 = as in the params.
   * @param given_up asked before each of the scales that are tried; once it holds, no more are. May be empty.
   */
  ViewMatch match(const PreparedImage& reference, const PreparedImage& current, GeometryModel model,
                  double inlier_threshold = 0.0, const std::function<bool()>& given_up = {}) const;

private:
  PointViewMatcherParams params_;
};

}  // namespace view_servo
