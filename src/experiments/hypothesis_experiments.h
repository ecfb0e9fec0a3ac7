// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Scenes that are drawn; every algorithm and level of noise sees the same ones. */
constexpr Repetition HYPOTHESIS_SCENES{ "scenes", 20, 3, 1 };

/**
 * The simulation of section 9.6 of the thesis: 500 points in a box, seen by two cameras, and an association matrix that
 * is the identity with |N(0, sigma)| off its diagonal. Rows are what RANSAC, importance sampling, the modified
 * algorithm and OpenCV's USAC_MAGSAC find, at several sigmas and numbers of iterations.
 */
void runMultiHypothesisExperiment(const ExperimentContext& context, std::ostream& csv);

/** Runs of each algorithm on each pair; each run draws other samples. */
constexpr Repetition REAL_PAIR_RUNS{ "runs of each algorithm on each pair", 20, 3, 1 };

/**
 * The same algorithms on the corners of real pairs (kusvod2, adelaidermf). What they find is measured at points that
 * were matched by hand. Rows hold medians over the runs.
 */
void runRealPairsExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
