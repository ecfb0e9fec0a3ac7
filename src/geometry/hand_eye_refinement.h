// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hand_eye_problem.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo::hand_eye
{
/** How large errors are, and what that means for a state. */
struct ErrorModel
{
  double ratio = 0.0;       ///< of the arm's error [rad] to that of images [px]
  double variance = 0.0;    ///< of images [px²]
  Eigen::MatrixXd inverse;  ///< of the normal equations' matrix, DOF x DOF: covariance of the state for a variance of 1
};

/**
 * Lowers the squared errors of some poses. @param whitening of all poses, ROWS x ROWS, so that whitened errors have a
 * covariance of identity times some factor.
 */
void fit(const Problem& problem, const Indices& used, const std::vector<Eigen::MatrixXd>& whitening, State& state);

/**
 * Refines a state by the poses that agree. @param lever as HandEyeParams::arm_lever. @param used those that agree, in
 * ascending order. @return empty, or why the poses do not tell it.
 */
std::string refine(const Problem& problem, double lever, State& state, Indices& used, ErrorModel& model);

}  // namespace view_servo::hand_eye
