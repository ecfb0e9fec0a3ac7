// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/matching/association.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Robust estimation in which each point keeps several candidate matches (thesis ch. 9). The support of a model is the
 * best one-to-one matching among those entries of the association matrix that agree with the model.
 */

/** Where samples come from. */
enum class HypothesisSampling
{
  CANDIDATES,  ///< from the maximum-weight matching of the association: the modified algorithm (9.5.1)
  IMPORTANCE   ///< from all entries, by their weight: Algorithm 2
};

/** Options of estimation with several hypotheses a point, besides those of the RANSAC loop. */
struct MultiHypothesisParams
{
  HypothesisSampling sampling = HypothesisSampling::CANDIDATES;
  int entries_per_row = 10;         ///< associations kept of each reference point, the strongest (9.5)
  double association_weight = 3.0;  ///< lambda of 9.6.3: what the strongest association adds to a match [px]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(MultiHypothesisParams& params);

/** The model found, with its one-to-one matches. */
template <typename Model>
struct MultiHypothesisResult
{
  std::optional<Model> model;        ///< empty: no sample gave one
  std::vector<Association> matches;  ///< one-to-one matches that agree with the model, in the order of rows
  RansacStatistics statistics;
};

/**
 * Fundamental matrix (x_curᵀ F x_ref = 0) from an association of `reference` (rows) with `current` points (columns). An
 * entry agrees with F when its Sampson distance is under T = ransac.inlier_threshold. The matching maximises the sum of
 * T - distance + lambda a / max a, with a the weight of an entry. Models are compared by the number of matches, then by
 * that sum. ransac.improvement_stage adds the N2 replacements of Algorithm 2; ransac.sampling is used for CANDIDATES
 * only.
 * @param view_consistency_threshold as in FundamentalEstimator.
 * @throws std::invalid_argument when the sizes of the association are not those of the lists.
 */
MultiHypothesisResult<FundamentalEstimator::Model> estimateFundamental(const AssociationMatrix& association,
                                                                       const Points& reference, const Points& current,
                                                                       const RansacParams& ransac,
                                                                       const MultiHypothesisParams& params, Rng& rng,
                                                                       double view_consistency_threshold = 0.0);

/** Homography (x_cur ~ H x_ref) in the same way; the distance is the RMS of the transfer errors in the two images. */
MultiHypothesisResult<HomographyEstimator::Model> estimateHomography(const AssociationMatrix& association,
                                                                     const Points& reference, const Points& current,
                                                                     const RansacParams& ransac,
                                                                     const MultiHypothesisParams& params, Rng& rng);

}  // namespace view_servo
