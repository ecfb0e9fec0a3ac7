// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Calibrations in each of the two worlds of the arm. */
constexpr Repetition HAND_EYE_RUNS{ "calibrations in each world", 20, 1, 1 };

/**
 * Hand-eye calibration of the simulated arm from a stored view and 12 poses, drawn at random around the goal. The view
 * is found in the images, followed in them, and averaged while the arm stands, as homography_tracker and
 * calibrate_hand_eye do. Encoders have a noise of 0.1 mrad, images one of 2 grey levels; the camera is 20 mm and 3
 * degrees from where the arm's description has it.
 */
void runHandEyeExperiment(const ExperimentContext& context, std::ostream& csv);

/**
 * Hand-eye calibration of a real arm (eyeinhand_franka_visp): each of the eight images is once the stored view, and the
 * homographies of a chessboard's corners stand in for those of a tracker. It is compared with cv::calibrateHandEye,
 * which is given the size of the board's squares: once without that size, and once with the distance of the plane that
 * follows from it; both with the camera as its file has it, and with the lens's distortion estimated from the same
 * corners.
 */
void runHandEyeRealExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
