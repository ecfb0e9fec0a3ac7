// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Starts at random places in three rooms, of all rooms together. */
constexpr Repetition STRUCTURE_STARTS{ "random starts", 24, 3, 5 };

/**
 * What Homing::structure() is worth, for both kinds of base in simulated rooms. In each room a run from a random start
 * learns the view's structure; then the base homes from other starts with and without it. Says how exact the depths
 * are, how soon the distance is known in metres and how exactly, and how long homing takes.
 */
void runStructureExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
