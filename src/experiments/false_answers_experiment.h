// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <iosfwd>

namespace view_servo
{
/** Pairs of pictures of different scenes; mirrored pictures and repeating walls are half as many each. */
constexpr Repetition UNRELATED_PAIRS{ "unrelated pairs", 100, 2, 1 };

/**
 * Pairs that no geometry relates, so that every answer is a false one: pictures of different scenes; a picture and the
 * mirror image of one of the same scene; drawn walls of windows and of tiles that repeat, moved by one period. Real
 * pictures are all those of VIEW_SERVO_DATA that have 320 pixels each way. A row for each pair, matcher (points, lines,
 * scene) and model: whether an answer was given, its inliers and its significance, as -log10 of the false alarms.
 */
void runFalseAnswersExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
