// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "hand_eye_refinement.h"

#include "decompositions.h"
#include "levenberg_marquardt.h"

#include <algorithm>
#include <cmath>

namespace view_servo::hand_eye
{
namespace
{
/** Sums of Jᵀ J (DOF x DOF) and Jᵀ e (DOF x 1). */
struct NormalEquations
{
  explicit NormalEquations(const Problem& problem)
    : matrix(Eigen::MatrixXd::Zero(DOF, DOF)), gradient(Eigen::VectorXd::Zero(DOF))
  {
    matrix(DISTANCE, DISTANCE) = problem.distanceWeight();
    matrix(FOCAL_LENGTH, FOCAL_LENGTH) = problem.focalLengthWeight();
  }

  void add(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& errors)
  {
    const Eigen::MatrixXd transposed = jacobian.transpose();
    matrix += product(transposed, jacobian);
    gradient += applied(transposed, errors);
  }

  Eigen::MatrixXd matrix;
  Eigen::VectorXd gradient;
};

/** For levenbergMarquardt(): errors of some poses, weighted. Steps are those of moved(). */
class Refinement
{
public:
  using State = hand_eye::State;
  static constexpr int DOF = Eigen::Dynamic;  // which spares the compiler a minute

  Refinement(const Problem& problem, const Indices& used, const std::vector<Eigen::MatrixXd>& whitening)
    : problem_(problem), used_(used), whitening_(whitening)
  {
  }

  double cost(const State& state) const
  {
    const double distance_error = problem_.distanceError(state);
    const double focal_error = std::log(state.focal_scale);
    double sum = problem_.distanceWeight() * distance_error * distance_error +
                 problem_.focalLengthWeight() * focal_error * focal_error;
    for (const std::size_t i : used_)
    {
      Eigen::VectorXd errors;
      if (!problem_.errors(state, i, errors))
      {
        return ENDLESS;
      }
      sum += applied(whitening_[i], errors).squaredNorm();
    }
    return sum;
  }

  void linearize(const State& state, Eigen::MatrixXd& jtj, Eigen::VectorXd& gradient) const
  {
    NormalEquations equations(problem_);
    equations.gradient(DISTANCE) = problem_.distanceWeight() * problem_.distanceError(state);
    equations.gradient(FOCAL_LENGTH) = problem_.focalLengthWeight() * std::log(state.focal_scale);
    for (const std::size_t i : used_)
    {
      Eigen::VectorXd errors;
      Eigen::MatrixXd jacobian;
      Eigen::MatrixXd by_arm;
      problem_.errors(state, i, errors);
      problem_.linearize(state, i, jacobian, by_arm);
      equations.add(product(whitening_[i], jacobian), applied(whitening_[i], errors));
    }
    jtj = equations.matrix;
    gradient = equations.gradient;
  }

  static State moved(const State& state, const Eigen::VectorXd& step)
  {
    return hand_eye::moved(state, step);
  }

private:
  const Problem& problem_;
  const Indices& used_;
  const std::vector<Eigen::MatrixXd>& whitening_;
};

/** Covariance of a pose's errors, for one pixel of error in images. */
Eigen::MatrixXd covarianceOf(const Eigen::MatrixXd& by_arm, double ratio, double lever)
{
  Eigen::MatrixXd scaled = by_arm;
  scaled.leftCols(3) *= ratio * lever;
  scaled.rightCols(3) *= ratio;
  Eigen::MatrixXd covariance = product(scaled, scaled.transpose());
  covariance.diagonal().array() += 1.0;
  return covariance;
}

/** The ratio of errors with the largest restricted likelihood (Patterson & Thompson 1971), tried out. */
ErrorModel errorModel(const Problem& problem, const State& state, const Indices& used, double lever)
{
  constexpr int TRIALS = 37;
  constexpr double LEAST = 1e-6;  // [rad/px]
  constexpr double STEP = 1.4;
  std::vector<Eigen::VectorXd> errors(used.size());
  std::vector<Eigen::MatrixXd> jacobians(used.size());
  std::vector<Eigen::MatrixXd> by_arm(used.size());
  for (std::size_t k = 0; k < used.size(); ++k)
  {
    problem.errors(state, used[k], errors[k]);
    problem.linearize(state, used[k], jacobians[k], by_arm[k]);
  }
  const double freedom = static_cast<double>(ROWS * used.size()) - DOF + problem.knownUnknowns();
  ErrorModel best;
  double best_likelihood = -ENDLESS;
  for (int trial = 0; trial < TRIALS; ++trial)
  {
    ErrorModel model;
    model.ratio = LEAST * std::pow(STEP, trial);
    NormalEquations equations(problem);
    double squares = 0.0;
    double logarithms = 0.0;
    for (std::size_t k = 0; k < used.size(); ++k)
    {
      const Eigen::MatrixXd whitening = whiteningOf(covarianceOf(by_arm[k], model.ratio, lever));
      const Eigen::VectorXd white = applied(whitening, errors[k]);
      equations.add(product(whitening, jacobians[k]), white);
      squares += white.squaredNorm();
      logarithms -= 2.0 * whitening.diagonal().array().log().sum();
    }
    const SymmetricDecomposition solver(equations.matrix);
    squares -= equations.gradient.dot(solver.solve(equations.gradient));
    model.variance = std::max(squares, 1e-16) / freedom;
    logarithms += solver.diagonal().array().max(1e-300).log().sum();
    const double likelihood = -freedom * std::log(model.variance) - logarithms;
    if (likelihood > best_likelihood)
    {
      best_likelihood = likelihood;
      model.inverse = solver.inverse();
      best = model;
    }
  }
  return best;
}

std::vector<Eigen::MatrixXd> whiteningsOf(const Problem& problem, const State& state, double ratio, double lever)
{
  std::vector<Eigen::MatrixXd> result;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    Eigen::MatrixXd by_state;
    Eigen::MatrixXd by_arm;
    problem.linearize(state, i, by_state, by_arm);
    result.push_back(whiteningOf(covarianceOf(by_arm, ratio, lever)));
  }
  return result;
}

/**
 * How far each pose is from what the others say, squared, in units that are the same for all: errors that a pose would
 * have had it not been used, against the covariance of these.
 */
std::vector<double> disagreements(const Problem& problem, const State& state, const Indices& used,
                                  const ErrorModel& model, double lever)
{
  std::vector<double> result;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    Eigen::VectorXd errors;
    if (!problem.errors(state, i, errors))
    {
      result.push_back(ENDLESS);
      continue;
    }
    Eigen::MatrixXd jacobian;
    Eigen::MatrixXd by_arm;
    problem.linearize(state, i, jacobian, by_arm);
    const Eigen::MatrixXd whitening = whiteningOf(covarianceOf(by_arm, model.ratio, lever));
    jacobian = product(whitening, jacobian);
    errors = applied(whitening, errors);
    const bool is_used = std::find(used.begin(), used.end(), i) != used.end();
    const Eigen::MatrixXd leverage = product(product(jacobian, model.inverse), jacobian.transpose());
    Eigen::MatrixXd covariance = is_used ? Eigen::MatrixXd(-leverage) : leverage;
    covariance.diagonal().array() += 1.0;
    result.push_back(std::max(0.0, errors.dot(solveSymmetric(covariance, errors))));
  }
  return result;
}

}  // namespace

void fit(const Problem& problem, const Indices& used, const std::vector<Eigen::MatrixXd>& whitening, State& state)
{
  constexpr int ITERATIONS = 50;
  levenbergMarquardt(Refinement(problem, used, whitening), state, ITERATIONS);
}

std::string refine(const Problem& problem, double lever, State& state, Indices& used, ErrorModel& model)
{
  constexpr int ROUNDS = 12;
  constexpr double TOO_FAR = 5.0;  // times the median disagreement, beyond which a pose disagrees; chance has 1 in 10^5
  constexpr double LEAST = ROWS * 0.02 * 0.02;  // so little disagreement means nothing [px²]
  std::vector<Indices> before;
  while (std::find(before.begin(), before.end(), used) == before.end() && before.size() < ROUNDS)
  {
    before.push_back(used);
    model = errorModel(problem, state, used, lever);
    const std::vector<Eigen::MatrixXd> whitening = whiteningsOf(problem, state, model.ratio, lever);
    fit(problem, used, whitening, state);
    model = errorModel(problem, state, used, lever);
    const std::vector<double> all = disagreements(problem, state, used, model, lever);
    std::vector<double> of_used;
    for (const std::size_t i : used)
    {
      of_used.push_back(all[i]);
    }
    const double limit = std::max(TOO_FAR * medianOf(of_used), LEAST);
    used.clear();
    for (std::size_t i = 0; i < all.size(); ++i)
    {
      if (all[i] <= limit)
      {
        used.push_back(i);
      }
    }
    if (used.size() < LEAST_POSES || 2 * used.size() < all.size())
    {
      return "the poses contradict one another: fewer than half of them agree on one mounting of the camera; check "
             "that the frames are right, and that the view's plane has not been moved";
    }
  }
  used = before.back();
  return "";
}

}  // namespace view_servo::hand_eye
