// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/matching/association.h"

#include <vector>

namespace view_servo
{
/**
 * Exact maximum-weight bipartite matching (thesis 4.5): the set of entries, no two in one row or column, of largest
 * total weight. Shortest augmenting paths with potentials over the sparse entries, in which every row may also stay
 * unmatched at weight 0 (Jonker & Volgenant 1987; Duff & Koster 2001). O(rows * entries * log) at worst.
 * @return the chosen entries, heaviest first; ties in the order of rows.
 */
std::vector<Association> maximumWeightMatching(const AssociationMatrix& association);

/** Repeatedly takes the largest entry and strikes out its row and column; for comparison. Same order of results. */
std::vector<Association> greedyMatching(const AssociationMatrix& association);

}  // namespace view_servo
