// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
constexpr Repetition MOUNT_RUNS{ "calibrations", 20, 1, 1 };

/**
 * Calibration of where the simulated base's camera is mounted, from 20 poses before a photo on a wall: see MountTrial.
 * Images have a noise of 2 grey levels, odometry one of 10 % of each 20 ms, turns that it measures too large by 2 % and
 * adds to ways by 0.02 rad/m (standard deviations, drawn for each calibration).
 */
void runMountExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
