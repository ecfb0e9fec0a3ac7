// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * The motions that homographies tell of, and the 2.5D error of thesis chapter 8, for a real arm that carries a camera over
 * a chessboard (eyeinhand_franka_visp): each image against each other one, beside what the arm's joints say.
 *
 * Of two decompositions the one is taken whose plane all images of the same reference agree on, as PlaneFilter does it in
 * time; the arm takes no part in that. What the homography says needs the board's corners and the camera alone: once as its
 * file gives it, without distortion, once with the distortion that the board itself tells of.
 */
void runArmGeometryExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
