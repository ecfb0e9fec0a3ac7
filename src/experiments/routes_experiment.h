// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Random routes in two rooms, of both together. */
constexpr Repetition ROUTES{ "random routes", 20, 2, 7 };

/**
 * Routes of 2 m with two bends through simulated rooms, recorded and followed from up to 0.15 m beside their begin;
 * each under plain and under hard conditions. Hard are: odometry that measures distances and turns 5 % too long, light
 * x 0.7 and image noise of 5 grey levels when the route is followed.
 */
void runRoutesExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
