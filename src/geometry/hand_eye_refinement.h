// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hand_eye_problem.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo::hand_eye
{
/** How large the errors of arm and images are, and how uncertain a state is by them. */
struct ErrorModel
{
  double ratio = 0.0;       ///< standard deviation of the arm's rotation over that of a corner's coordinate [rad/px]
  double variance = 0.0;    ///< variance of a corner's coordinate [px²]
  Eigen::MatrixXd inverse;  ///< covariance of the state when that variance is 1, DOF x DOF
};

/**
 * Minimises the sum of squared whitened errors of the poses `used`, from `state`. @param whitening of all poses, ROWS x
 * ROWS, so that whitened errors have a covariance of identity times some factor.
 */
void fit(const Problem& problem, const Indices& used, const std::vector<Eigen::MatrixXd>& whitening, State& state);

/**
 * Refines a state by the poses that agree. @param lever as HandEyeParams::arm_lever. @param used those that agree, in
 * ascending order. @return empty, or why the poses do not tell it.
 */
std::string refine(const Problem& problem, double lever, State& state, Indices& used, ErrorModel& model);

}  // namespace view_servo::hand_eye
