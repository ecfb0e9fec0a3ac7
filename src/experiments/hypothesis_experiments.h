// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * The simulation of thesis 9.6: 500 points in a box, an association matrix that is the identity but for |N(0, sigma)| off
 * its diagonal, and what RANSAC, importance sampling, the modified algorithm and OpenCV's USAC_MAGSAC find.
 */
void runMultiHypothesisExperiment(const ExperimentContext& context, std::ostream& csv);

/** The same estimators on the corners of real pairs (kusvod2, adelaidermf), measured at points matched by hand. */
void runRealPairsExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
