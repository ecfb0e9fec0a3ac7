// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Runs of RANSAC on the same candidates. */
constexpr Repetition PROFILE_RUNS{ "runs of RANSAC", 5, 1, 1 };

/**
 * Figures 6.8 to 6.10 of the thesis: candidate matches by plain votes, and what RANSAC for a fundamental matrix (1 px)
 * leaves of them. Varied are which pairs of corners have a profile (within D_c, or the K_c nearest), the number of
 * features N_f, and which profiles are compared (within D_v, or the K_v nearest). The pairs are real ones
 * (oxford_affine, vgg_merton1, kusvod2); rows hold medians over the runs.
 */
void runProfileParametersExperiment(const ExperimentContext& context, std::ostream& csv);

/** Runs of RANSAC on the same candidates, each in all variants. */
constexpr Repetition VIEW_CONSISTENCY_RUNS{ "runs of RANSAC", 9, 1, 1 };

/**
 * Tables 6.2 and 6.3 of the thesis: the view constraint before RANSAC and within it, on real pairs (kusvod2,
 * vgg_merton1). RANSAC with the constraint within it is compared with RANSAC that draws the same samples and solves
 * them all. Numbers and times (of one thread) are medians over the runs; `factor` is the median of the ratio of the two
 * times.
 */
void runViewConsistencyExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
