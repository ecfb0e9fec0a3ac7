// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Tables 4.1 and 4.2 of the thesis: how many of the 25 and 50 candidate matches of lines with the most votes are
 * correct. The rows are pairs and triplets of lines, largest distances of 25, 75 and 125 px to their intersections, a
 * fine and a coarse scale of edges, and two orders of a line's end points: the thesis' (upright) and by contrast.
 *
 * The thesis judged the matches by eye. Here only candidates count whose reference segment lies on a labelled line of
 * the real pairs (line_matching_benchmark, vgg_merton1).
 */
void runLinesTableExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
