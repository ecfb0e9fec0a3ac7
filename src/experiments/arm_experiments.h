// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Runs from each of the six starts. */
constexpr Repetition ARM_RUNS{ "runs from each start", 20, 2, 1 };

/**
 * Table 8.1 of the thesis: 2.5D servoing of the simulated arm to two views, from three starts each. At the third start
 * there are things that were not there when the view was stored. Every second run has another light than the stored
 * view. All runs have image noise of 2 grey levels, encoder noise of 0.1 mrad, a hand-eye calibration that is off by 2
 * mm and 0.5 degrees, and a focal length that is 0.5 % too long; each starts some millimetres and degrees beside the
 * start, with noise of its own.
 */
void runArmExperiment(const ExperimentContext& context, std::ostream& csv);

/**
 * The same with two views of scenes that have depth, which are followed as such; a search takes 0.6 s instead of 0.3.
 * What says that it has converged and is more than 2 mm or 0.2 degrees off is wrong, of planes more than 5 mm or 0.5
 * degrees.
 */
void runArmSceneExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
