// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <iosfwd>

namespace view_servo
{
/** Pictures that show nothing of the stored views, each changed by chance. */
constexpr Repetition UNKNOWN_PICTURES{ "pictures of unknown scenes", 500, 4, 1 };

/**
 * Which stored view an image shows: how often ViewIndex, and beside it ORB words by OpenCV's BOW classes, name a right
 * view first or among the first five or ten; how often the matcher verifies right and wrong ones; what it costs.
 * @throws std::runtime_error naming a file that cannot be read.
 */
void runRecognitionExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
