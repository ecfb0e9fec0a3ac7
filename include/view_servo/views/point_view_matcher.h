// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/matching/guided_matching.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/multi_hypothesis.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/view_consistency.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace view_servo
{
/** Where the constraint on five points is used (thesis 6.3); it has no meaning for homographies within RANSAC. */
enum class ViewConsistency
{
  OFF,     ///< nowhere
  BEFORE,  ///< method 1: candidates are filtered; for GeometryEstimator::RANSAC
  WITHIN   ///< method 2: samples are tested
};

/** How a geometry is found in an association (thesis ch. 9). */
enum class GeometryEstimator
{
  RANSAC,            ///< one candidate for each point
  MULTI_HYPOTHESIS,  ///< samples from the candidates, support from all associations: the modified algorithm (9.5.1)
  IMPORTANCE         ///< samples and support from all associations: Algorithm 2, which takes many iterations
};

/** Options of everything between two images and their geometry. */
struct PointViewMatcherParams
{
  PointMatcherParams points;
  RansacParams ransac;
  GeometryEstimator estimator = GeometryEstimator::RANSAC;     ///< how the geometry is found
  MultiHypothesisParams hypotheses;                            ///< `sampling` is chosen by `estimator`
  ViewConsistency view_consistency = ViewConsistency::WITHIN;  ///< which sets of five matches are tested
  ViewConsistencyParams consistency;
  bool guided = true;  ///< look for more matches along the geometry found
  GuidedParams guidance;
  /**
   * Share of the current image's profiles that vote in the first attempt. Unless the geometry that they give
   * is far more significant than min_log_significance asks for, a second attempt uses all of them.
   */
  double first_share = 0.6;
  bool scale_search = true;  ///< try other scale ratios and coarser scales when the full images give no geometry
  bool side_search = true;   ///< when that fails, too, try the reference as it would look from the sides
  double min_log_significance = 6.0;  ///< least ViewMatch::log_significance of a geometry that is accepted
  bool unique = true;                 ///< refuse a geometry when another one, a shift off, fits nearly as well
  bool refuse_mirrored = true;        ///< refuse a current image that shows the reference better when mirrored
  double min_log_parallax = 3.0;      ///< least Parallax::significance() of a fundamental matrix, off its best plane
  std::uint64_t seed = 1;             ///< fixes all random draws

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PointViewMatcherParams& params);

/**
 * Matches two views of a scene by intensity profiles. Stateless between calls: the same input gives the same result.
 */
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
   * @param given_up asked before each pair of scales; once it returns true, no further pair is tried. May be empty.
   * @throws std::invalid_argument when the threshold is negative or not finite.
   */
  ViewMatch match(const PreparedImage& reference, const PreparedImage& current, GeometryModel model,
                  double inlier_threshold = 0.0, const std::function<bool()>& given_up = {}) const;

private:
  PointViewMatcherParams params_;
};

}  // namespace view_servo
