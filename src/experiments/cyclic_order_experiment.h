// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Figures 7.5 to 7.11: cyclic order against plain votes, without guided matching, on rendered planes and cylinders
 * turned by growing angles; with VIEW_SERVO_DATA set also with the pictures of oxford_affine, and on oxford_affine and
 * kusvod2 themselves. The brief form needs no data.
 */
void runCyclicOrderExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
