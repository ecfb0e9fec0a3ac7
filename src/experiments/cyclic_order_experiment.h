// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Drawn pictures of each of two kinds, which are put on planes. */
constexpr Repetition DRAWN_PICTURES{ "drawn pictures of each kind on planes", 2, 1, 1 };

/**
 * Figures 7.5 to 7.11 of the thesis: cyclic order against plain votes, without guided matching, on rendered planes and
 * cylinders that are turned by growing angles. When VIEW_SERVO_DATA is set, pictures of oxford_affine are on them, too,
 * and the real pairs of oxford_affine and kusvod2 follow. The brief form needs no data.
 */
void runCyclicOrderExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
