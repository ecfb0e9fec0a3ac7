// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Figures 6.8 to 6.10: matches left by RANSAC for a fundamental matrix (1 px), by plain votes, for corner pairs within
 * D_c or the K_c nearest, N_f features, and profiles within D_v or the K_v nearest. Real pairs of oxford_affine,
 * vgg_merton1 and kusvod2; medians of several seeds.
 */
void runProfileParametersExperiment(const ExperimentContext& context, std::ostream& csv);

/**
 * Tables 6.2 and 6.3: the view constraint before RANSAC and within it, on pairs of kusvod2 and vgg_merton1.
 * Within it is compared with RANSAC that draws the same samples and solves them all. RANSAC's times, on its one thread,
 * and numbers are medians of several seeds, `factor` is that of the ratios of the two times.
 */
void runViewConsistencyExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
