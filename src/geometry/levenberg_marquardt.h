// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "decompositions.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>

namespace view_servo
{
/** Huber's cost of a squared error: quadratic up to `width`, linear beyond; `width` may be infinite. */
inline double huberCost(double squared_error, double width)
{
  return squared_error <= width * width ? squared_error : width * (2.0 * std::sqrt(squared_error) - width);
}

/** Weight that makes reweighted least squares descend huberCost(). */
inline double huberWeight(double squared_error, double width)
{
  return squared_error <= width * width ? 1.0 : width / std::sqrt(squared_error);
}

/**
 * Levenberg-Marquardt with Marquardt's diagonal damping on accumulated normal equations; a step is taken only when it
 * lowers the cost. Returns whether `state` was improved.
 *
 * A Problem has
 *  - `State`, `static constexpr int DOF`,
 *  - `double cost(const State&) const`: infinite or NaN where the state is not allowed,
 *  - `void linearize(const State&, Matrix<DOF, DOF>& jtj, Vector<DOF>& gradient) const`: sets the sums of J^T J and J^T
 *    r,
 *  - `State moved(const State&, const Vector<DOF>& step) const`.
 */
template <typename Problem>
bool levenbergMarquardt(const Problem& problem, typename Problem::State& state, int max_iterations)
{
  constexpr double MIN_DAMPING = 1e-12;
  constexpr double MAX_DAMPING = 1e12;
  constexpr double RELATIVE_TOLERANCE = 1e-10;
  using Vector = Eigen::Matrix<double, Problem::DOF, 1>;
  using Matrix = Eigen::Matrix<double, Problem::DOF, Problem::DOF>;

  double cost = problem.cost(state);
  double damping = 1e-4;
  bool improved = false;
  for (int iteration = 0; iteration < max_iterations && std::isfinite(cost) && cost > 0.0; ++iteration)
  {
    Matrix jtj;
    Vector gradient;
    problem.linearize(state, jtj, gradient);

    double decrease = 0.0;
    while (!(decrease > 0.0) && damping < MAX_DAMPING)
    {
      Matrix damped = jtj;
      damped.diagonal() *= 1.0 + damping;
      const Vector step = -solveSymmetric(damped, gradient);
      const typename Problem::State candidate = problem.moved(state, step);
      const double candidate_cost = problem.cost(candidate);
      if (candidate_cost < cost)
      {
        decrease = cost - candidate_cost;
        state = candidate;
        damping = std::max(0.1 * damping, MIN_DAMPING);
      }
      else
      {
        damping *= 10.0;
      }
    }
    if (!(decrease > 0.0))
    {
      break;
    }
    improved = true;
    const bool converged = decrease < RELATIVE_TOLERANCE * cost;
    cost -= decrease;
    if (converged)
    {
      break;
    }
  }
  return improved;
}

}  // namespace view_servo
