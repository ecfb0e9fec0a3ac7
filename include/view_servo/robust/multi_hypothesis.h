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
 * Robust estimation that does not commit itself to one match a point (thesis ch. 9): a model is supported by the best
 * one-to-one matching among all entries of the association matrix that agree with it.
 */

enum class HypothesisSampling
{
  CANDIDATES,  ///< from the maximum-weight matching of the association: the modified algorithm (9.5.1)
  IMPORTANCE   ///< from all entries, by their weight: Algorithm 2
};

/** Options of estimation with several hypotheses a point, besides those of the RANSAC loop. */
struct MultiHypothesisParams
{
  HypothesisSampling sampling = HypothesisSampling::CANDIDATES;
  int entries_per_row = 10;         ///< strongest associations of a reference point that are kept (9.5), >= 1
  double association_weight = 3.0;  ///< lambda of 9.6.3: of the strongest association, beside the fit [px], >= 0

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(MultiHypothesisParams& params);

template <typename Model>
struct MultiHypothesisResult
{
  std::optional<Model> model;        ///< empty: no sample gave one
  std::vector<Association> matches;  ///< one-to-one, that agree with the model, in the order of rows
  RansacStatistics statistics;
};

/**
 * Fundamental matrix (x_curᵀ F x_ref = 0) from an association of `reference` (rows) with `current` points (columns).
 * An entry agrees when its Sampson distance is under ransac.inlier_threshold, T; the matching maximises the sum of
 * T - distance + lambda a / max a; the support is the number of matches, then that sum. ransac.improvement_stage is N2 of
 * Algorithm 2. ransac.sampling is for CANDIDATES.
 * @param view_consistency_threshold as in FundamentalEstimator.
 * @throws std::invalid_argument when the sizes of the association are not those of the lists.
 */
MultiHypothesisResult<FundamentalEstimator::Model> estimateFundamental(const AssociationMatrix& association,
                                                                       const Points& reference, const Points& current,
                                                                       const RansacParams& ransac,
                                                                       const MultiHypothesisParams& params, Rng& rng,
                                                                       double view_consistency_threshold = 0.0);

/** Homography (x_cur ~ H x_ref) likewise, with the RMS transfer error of the two images. */
MultiHypothesisResult<HomographyEstimator::Model> estimateHomography(const AssociationMatrix& association,
                                                                     const Points& reference, const Points& current,
                                                                     const RansacParams& ransac,
                                                                     const MultiHypothesisParams& params, Rng& rng);

}  // namespace view_servo
