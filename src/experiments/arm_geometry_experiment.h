// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/**
 * Motions from homographies, and the error of 2.5D servoing (chapter 8 of the thesis), for a real arm that carries a
 * camera over a chessboard (eyeinhand_franka_visp): each image is compared with each other one, and the result with the
 * arm's joints.
 *
 * A homography can have two decompositions. The one is taken whose plane all images of the same reference agree on, as
 * PlaneFilter does it over time; the arm takes no part in that. The homographies depend only on the board's corners and
 * on the camera's calibration: first as its file gives it, without distortion, then with a distortion estimated from
 * the same corners.
 */
void runArmGeometryExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
