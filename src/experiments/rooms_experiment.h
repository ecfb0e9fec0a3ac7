// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <iosfwd>

namespace view_servo
{
constexpr Repetition DRAWN_WALK_PAIRS{ "drawn pairs of views of the walk", 120, 0, 1 };

/**
 * Fundamental matrices between real views of rooms and of buildings (hololens_indoor, kusvod2, adelaidermf): points and
 * lines beside OpenCV's SIFT and AKAZE with MAGSAC, on the same pictures in one run. Of the walk those pairs
 * that come with it, and others that are drawn of its views: 0.1 to 1.5 m and up to 60 degrees apart. A row for each
 * pair and method: whether an answer was given, its mean Sampson distance at true matches, its inliers, and the
 * processor time of the pair.
 */
void runRoomsExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
