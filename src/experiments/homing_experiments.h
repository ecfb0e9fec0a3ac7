// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Starts at random places in three rooms, of all rooms together. */
constexpr Repetition HOMING_STARTS{ "random starts", 100, 3, 5 };

/**
 * Homing in simulated rooms: the thesis' two runs in both modes, and runs from random starts, each under plain and
 * under hard conditions. Hard are: image noise of 5 grey levels, odometry that measures 5 % too much, light x 0.7,
 * somebody walking by, and a focal length that is 2 % too long.
 */
void runHomingExperiment(const ExperimentContext& context, std::ostream& csv);

/**
 * The same for a base that cannot slide, from starts whose yaw is off by up to 20 degrees; in mode servo alone. Hard is
 * besides: turns that odometry measures 20 % too large, and a base that does not move at less than 1 cm/s and 0.04
 * rad/s.
 */
void runHomingDifferentialExperiment(const ExperimentContext& context, std::ostream& csv);

/** The samples that matching and estimation draw; each pair is matched once. */
constexpr Repetition DIRECTION_DRAWS{ "", 0, 0, 1 };

/**
 * The heading from one real view to another (hololens_indoor), for all pairs in both directions, by a camera that
 * somebody carried by hand: its motion is not limited to a floor.
 */
void runDirectionsExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
