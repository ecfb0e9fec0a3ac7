// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/ransac.h"

#include <array>
#include <vector>

namespace view_servo
{
/**
 * Violation, in [0, 1], of the view constraint on five points seen in two scaled-orthographic views (thesis eq. 6.5,
 * 6.6; Carlsson 2000): zero for exact data, whatever the scales. As printed it depends on the units; here each
 * view's points are normalised (centroid 0, RMS distance 1) and the determinant is divided by the lengths of its rows.
 * Degenerate groups (all points coincide in a view, or a row vanishes, as it does for points on one plane) return 1.
 */
double viewConstraint(const std::array<Correspondence, 5>& five);

/** Options of viewConsistentCandidates(). */
struct ViewConsistencyParams
{
  double threshold = 0.03;         ///< a group of five is consistent below this violation
  double mean_increments = 100.0;  ///< groups are drawn until a candidate was counted this often, on average over all
  int max_groups = 200000;         ///< largest number of groups that are drawn

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ViewConsistencyParams& params);

/**
 * Thesis 6.3, method 1: counts how often each candidate takes part in a view-consistent group of five drawn at random,
 * then splits the counts by 2-means. Returns the indices of the upper cluster, ascending; all indices when there are
 * fewer than five candidates.
 */
std::vector<int> viewConsistentCandidates(const Correspondences& candidates, const ViewConsistencyParams& params,
                                          Rng& rng);

}  // namespace view_servo
