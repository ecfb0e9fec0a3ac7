// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Homing in the simulated rooms: the thesis' two runs in both modes, and the same 100 random starts under plain and under
 * hard conditions (noise of 5 grey levels, odometry 5 % long, light x 0.7, somebody walking by, focal length 2 % long).
 */
void runHomingExperiment(const ExperimentContext& context, std::ostream& csv);

/** The heading from one real view to another, pair by pair, in both directions, for cameras that a person carried. */
void runDirectionsExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
