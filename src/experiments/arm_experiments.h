// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Table 8.1: 2.5D servoing of the simulated arm to two views, from three starts each, the third among things that were not
 * there when the view was stored; 20 runs a start, ten under the light of the stored view and ten under another. Image noise
 * of 2 grey levels, encoder noise of 0.1 mrad, hand-eye wrong by 2 mm and 0.5 degrees, focal length 0.5 % long; each run with
 * its own noise and its own few millimetres and degrees of start.
 */
void runArmExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
