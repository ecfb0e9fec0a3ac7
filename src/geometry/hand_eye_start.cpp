// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "hand_eye_start.h"

#include "decompositions.h"
#include "hand_eye_refinement.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace view_servo::hand_eye
{
namespace
{
/** The camera's rotation on the flange from three poses; not finite when they do not tell it. */
Eigen::Matrix3d rotationOnFlange(const Problem& problem, const Indices& three,
                                 const std::vector<EuclideanHomography>& motions)
{
  std::vector<cv::Mat> rotations[2];
  std::vector<cv::Mat> translations[2];
  const auto append = [](const Eigen::Matrix3d& r, const Eigen::Vector3d& t, std::vector<cv::Mat>& rotation,
                         std::vector<cv::Mat>& translation) {
    cv::Mat matrix;
    cv::Mat vector;
    cv::eigen2cv(r, matrix);
    cv::eigen2cv(t, vector);
    rotation.push_back(matrix);
    translation.push_back(vector);
  };
  for (const std::size_t i : three)
  {
    const Eigen::Isometry3d flange = problem.observation(i).base_in_flange.inverse();
    append(flange.linear(), flange.translation(), rotations[0], translations[0]);
    append(motions[i].rotation, motions[i].translation_over_distance, rotations[1], translations[1]);
  }
  cv::Mat matrix;
  cv::Mat vector;
  try
  {
    // The rotation alone counts: it does not depend on the scale of translations, which is not known.
    cv::calibrateHandEye(rotations[0], translations[0], rotations[1], translations[1], matrix, vector,
                         cv::CALIB_HAND_EYE_HORAUD);
  }
  catch (const cv::Exception&)
  {
    return Eigen::Matrix3d::Constant(NONE);
  }
  Eigen::Matrix3d x;
  cv::cv2eigen(matrix, x);
  return x.allFinite() ? nearestRotation(x) : x;
}

/**
 * The camera's place on the flange [m], then the plane's distance from the view's camera [m], from three poses and the
 * camera's rotation on the flange.
 */
Eigen::Vector4d placeAndDistance(const Problem& problem, const Indices& three,
                                 const std::vector<EuclideanHomography>& motions, const Eigen::Matrix3d& rotation)
{
  // (R_A - I) t_X - d R_X t_B = -t_A for each of the three motions.
  Eigen::MatrixXd a(9, 3);
  Eigen::VectorXd by_distance(9);
  Eigen::VectorXd b(9);
  for (int row = 0; row < 3; ++row)
  {
    const std::size_t i = three[static_cast<std::size_t>(row)];
    const std::size_t k = three[static_cast<std::size_t>((row + 1) % 3)];
    const Eigen::Isometry3d motion =
        problem.observation(k).base_in_flange * problem.observation(i).base_in_flange.inverse();
    const Eigen::Matrix3d turn = motions[k].rotation * motions[i].rotation.transpose();
    const Eigen::Vector3d way = motions[k].translation_over_distance - turn * motions[i].translation_over_distance;
    a.middleRows<3>(3 * row) = motion.linear() - Eigen::Matrix3d::Identity();
    by_distance.segment<3>(3 * row) = -(rotation * way);
    b.segment<3>(3 * row) = -motion.translation();
  }
  Eigen::Vector4d solution;
  if (std::isnan(problem.knownDistance()))
  {
    a.conservativeResize(Eigen::NoChange, 4);
    a.col(3) = by_distance;
    solution = solveSymmetric(product(a.transpose(), a), applied(a.transpose(), b));
  }
  else
  {
    b -= problem.knownDistance() * by_distance;
    solution << solveSymmetric(product(a.transpose(), a), applied(a.transpose(), b)), problem.knownDistance();
  }
  return solution;
}

/** Where the view's camera was, by one pose. */
Eigen::Isometry3d viewInBase(const Problem& problem, const State& state, std::size_t i,
                             const EuclideanHomography& motion)
{
  Eigen::Isometry3d camera_from_view = Eigen::Isometry3d::Identity();
  camera_from_view.linear() = motion.rotation;
  camera_from_view.translation() = motion.translation_over_distance * state.distance;
  return problem.observation(i).base_in_flange.inverse() * state.camera_in_flange * camera_from_view;
}

/**
 * The state from three poses and the plane's direction, in closed form. @return false when they do not tell it.
 */
bool solve(const Problem& problem, const Indices& three, const std::vector<EuclideanHomography>& motions, State& state)
{
  const Eigen::Matrix3d rotation = rotationOnFlange(problem, three, motions);
  if (!rotation.allFinite())
  {
    return false;
  }
  const Eigen::Vector4d solution = placeAndDistance(problem, three, motions, rotation);
  if (!solution.allFinite() || !(solution(3) > 0.0))
  {
    return false;
  }
  state.camera_in_flange = Eigen::Isometry3d::Identity();
  state.camera_in_flange.linear() = rotation;
  state.camera_in_flange.translation() = solution.head<3>();
  state.distance = solution(3);
  state.normal = motions[three.front()].normal;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (const std::size_t i : three)
  {
    const Eigen::Isometry3d view = viewInBase(problem, state, i, motions[i]);
    sum += view.linear();
    position += view.translation() / 3.0;
  }
  state.view_in_base = Eigen::Isometry3d::Identity();
  state.view_in_base.linear() = nearestRotation(sum);
  state.view_in_base.translation() = position;
  return state.view_in_base.matrix().allFinite();
}

/** The poses with the smallest errors. */
Indices best(const Problem& problem, const State& state, std::size_t count)
{
  std::vector<double> errors;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    errors.push_back(problem.squaredError(state, i));
  }
  Indices order(problem.size());
  std::iota(order.begin(), order.end(), std::size_t{ 0 });
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return errors[a] < errors[b]; });
  order.resize(std::min(count, order.size()));
  return order;
}

/** Squared errors of the poses with the smallest ones. */
double trimmedCost(const Problem& problem, const State& state, std::size_t count)
{
  std::vector<double> errors;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    errors.push_back(problem.squaredError(state, i));
  }
  std::sort(errors.begin(), errors.end());
  return std::accumulate(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(count), 0.0);
}

}  // namespace

bool robustStart(const Problem& problem, std::size_t count, State& start)
{
  constexpr std::size_t MOST_TRIPLES = 400;
  constexpr std::size_t REFINED = 3;
  constexpr int ROUNDS = 3;
  struct Candidate
  {
    State state;
    double cost;
  };
  const std::size_t n = problem.size();
  const std::size_t stride = n * (n - 1) * (n - 2) / 6 / MOST_TRIPLES + 1;
  const std::vector<Eigen::MatrixXd> plain(n, Eigen::MatrixXd::Identity(ROWS, ROWS));
  double best_cost = ENDLESS;
  for (const Eigen::Vector3d& normal : problem.normals())
  {
    const std::vector<EuclideanHomography> motions = problem.motionsBefore(normal);
    std::vector<Candidate> candidates;
    std::size_t number = 0;
    for (std::size_t i = 0; i < n; ++i)
    {
      for (std::size_t k = i + 1; k < n; ++k)
      {
        for (std::size_t l = k + 1; l < n; ++l)
        {
          State state;
          if (number++ % stride == 0 && solve(problem, { i, k, l }, motions, state))
          {
            candidates.push_back({ state, trimmedCost(problem, state, count) });
          }
        }
      }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    candidates.resize(std::min(candidates.size(), REFINED));
    for (Candidate& candidate : candidates)
    {
      for (int round = 0; round < ROUNDS && std::isfinite(candidate.cost); ++round)
      {
        const Indices used = best(problem, candidate.state, count);
        fit(problem, used, plain, candidate.state);
        candidate.cost = trimmedCost(problem, candidate.state, count);
      }
      if (candidate.cost < best_cost)
      {
        best_cost = candidate.cost;
        start = candidate.state;
      }
    }
  }
  return std::isfinite(best_cost);
}

}  // namespace view_servo::hand_eye
