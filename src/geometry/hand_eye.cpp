// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/hand_eye.h"

#include "decompositions.h"
#include "hand_eye_motion.h"
#include "hand_eye_problem.h"
#include "hand_eye_refinement.h"
#include "hand_eye_start.h"
#include "view_servo/parameters/join.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
using namespace hand_eye;

namespace
{
double sigmaOf(const Eigen::Matrix3d& covariance)
{
  return std::sqrt(std::max(0.0, singularValues(covariance).values(0)));
}

std::vector<HandEyeResidual> residualsOf(const Problem& problem, const State& state, const Indices& used)
{
  std::vector<HandEyeResidual> residuals;
  const std::vector<EuclideanHomography> motions = problem.motionsBefore(state.normal);
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    const Eigen::Isometry3d camera_by_arm =
        state.view_in_base.inverse() * problem.observation(i).base_in_flange.inverse() * state.camera_in_flange;
    const Eigen::Vector3d by_image =
        -motions[i].rotation.transpose() * motions[i].translation_over_distance * state.distance;
    HandEyeResidual residual;
    residual.used = std::find(used.begin(), used.end(), i) != used.end();
    residual.pixels = std::sqrt(problem.squaredError(state, i));
    residual.translation = (camera_by_arm.translation() - by_image).norm();
    residual.rotation = angleOf(camera_by_arm.linear() * motions[i].rotation);
    residuals.push_back(residual);
  }
  return residuals;
}

/** The poses that agree with a start, which most of them suit, to begin the refinement with. */
Indices agreeingWithStart(const Problem& problem, const State& start)
{
  constexpr double CLEARLY = 3.0;     // times the typical error, beyond which a pose is left out
  constexpr double CONSISTENT = 1.5;  // a normal distribution's standard deviation over its median error, about
  constexpr double LEAST = 0.1;       // errors that are none at the start [px]
  std::vector<double> errors;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    errors.push_back(std::sqrt(problem.squaredError(start, i)));
  }
  const double limit = CLEARLY * std::max(CONSISTENT * medianOf(errors), LEAST);
  Indices agreeing;
  for (std::size_t i = 0; i < errors.size(); ++i)
  {
    if (errors[i] <= limit)
    {
      agreeing.push_back(i);
    }
  }
  return agreeing;
}

/** Fills in what was estimated, and how uncertain that is. */
void fillEstimate(const State& state, const ErrorModel& model, const HandEyeParams& params, HandEyeResult& result)
{
  result.camera_in_flange = state.camera_in_flange;
  result.view_in_base = state.view_in_base;
  result.normal = state.normal;
  result.distance = state.distance;
  const Eigen::MatrixXd covariance = model.variance * model.inverse;
  result.covariance = covariance.topLeftCorner<6, 6>();
  result.distance_sigma = state.distance * std::sqrt(covariance(DISTANCE, DISTANCE));
  if (params.finds_focal_length)
  {
    result.focal_scale = state.focal_scale;
    result.focal_sigma = state.focal_scale * std::sqrt(covariance(FOCAL_LENGTH, FOCAL_LENGTH));
  }
  result.image_error = std::sqrt(model.variance);
  result.rotation_error = model.ratio * result.image_error;
  result.translation_error = params.arm_lever * result.rotation_error;
}

/** How far the poses that were used are from one another. */
HandEyeMotion motionOfUsed(const HandEyeView& view, const std::vector<HandEyePose>& poses, const Indices& used,
                           const Eigen::Vector3d& normal)
{
  std::vector<HandEyePose> chosen;
  for (const std::size_t i : used)
  {
    chosen.push_back(poses[i]);
  }
  return motionOf(Problem(view, chosen, NONE), chosen, normal);
}

/** What makes a result more certain. */
std::string remedyFor(const HandEyeResult& result)
{
  constexpr double ALONG = 0.8;  // cosine of the angle to an axis
  const Eigen::Vector3d weakest = singularValues(result.covariance.topLeftCorner<3, 3>()).u.col(0);
  // Poses around one point, at one distance from it, do not tell the distance from how far back the camera is mounted.
  return std::abs(weakest.dot(result.camera_in_flange.linear().col(2))) > ALONG
             ? "most of it along the camera's axis: add poses nearer to the plane and farther away, and poses beside "
               "each other without a turn between them, or tell the distance of the plane"
             : "add poses with larger turns about two axes";
}

}  // namespace

double HandEyeResult::translationSigma() const
{
  return sigmaOf(covariance.topLeftCorner<3, 3>());
}

double HandEyeResult::rotationSigma() const
{
  return sigmaOf(covariance.bottomRightCorner<3, 3>());
}

HandEyeResult calibrateHandEye(const HandEyeView& view, const std::vector<HandEyePose>& poses,
                               const HandEyeParams& params)
{
  constexpr double PART = 0.6;  // of the poses, which the start has to suit
  check(view, poses);
  if (!std::isnan(params.distance) && !(params.distance > 0.0 && std::isfinite(params.distance)))
  {
    throw std::invalid_argument("the distance of the plane has to be above 0");
  }
  const Problem problem(view, poses, params.distance, !params.finds_focal_length);
  HandEyeResult result;
  result.residuals.resize(poses.size());
  result.motion = motionOf(problem, poses);
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion: " + join(result.missing, "; ");
    return result;
  }

  State state;
  const auto count = static_cast<std::size_t>(std::ceil(PART * static_cast<double>(poses.size())));
  if (!robustStart(problem, count, state))
  {
    result.message =
        "the motions of arm and images do not fit one another for any mounting of the camera; check that the "
        "frames are right";
    return result;
  }
  Indices used = agreeingWithStart(problem, state);
  ErrorModel model;
  result.message = refine(problem, params.arm_lever, state, used, model);
  if (!result.message.empty())
  {
    result.residuals = residualsOf(problem, state, used);
    return result;
  }

  fillEstimate(state, model, params, result);
  HandEyeView true_view = view;
  true_view.k = withFocalScale(view.k, state.focal_scale);
  state.focal_scale = 1.0;
  result.residuals = residualsOf(Problem(true_view, poses, params.distance), state, used);
  result.motion = motionOfUsed(true_view, poses, used, state.normal);
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion, without the poses that disagree: " + join(result.missing, "; ");
    return result;
  }
  if (params.finds_focal_length && !(result.focal_sigma <= params.max_focal_sigma))
  {
    result.missing.push_back("the poses do not tell the focal length, which would be " +
                             rounded(result.focal_scale, 3) + " times what was said, uncertain by " +
                             rounded(1e2 * result.focal_sigma, 1) +
                             " % (standard deviation); add poses nearer and farther away, and poses that see the plane "
                             "from aside, or calibrate without it");
    result.message = result.missing.back();
    return result;
  }
  if (!(result.translationSigma() <= params.max_translation_sigma) ||
      !(result.rotationSigma() <= params.max_rotation_sigma))
  {
    result.missing.push_back("the result is uncertain by " + rounded(1e3 * result.translationSigma()) + " mm and " +
                             rounded(DEGREES * result.rotationSigma(), 2) + " degrees (standard deviation), " +
                             remedyFor(result));
    result.message = result.missing.back();
    return result;
  }
  result.found = true;
  return result;
}

}  // namespace view_servo
