// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/mount_calibration.h"

#include "decompositions.h"
#include "hand_eye_motion.h"
#include "mount_motion.h"
#include "mount_problem.h"
#include "mount_refinement.h"
#include "mount_start.h"
#include "view_servo/parameters/join.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
namespace mount
{
namespace
{
constexpr int DISTANCE = SHARED - 1;  // index of the logarithm of the plane's distance among the unknowns
constexpr int VIEW_HEIGHT = 7;        // of the view's height above the camera [m]

/** The start that fits best, over the directions that the plane may have. @return false when there is none. */
bool bestStart(const Problem& problem, const std::vector<PlanarPose>& odometry, const MountParams& params,
               Estimate& best, Indices& used)
{
  double least = hand_eye::ENDLESS;
  for (const Eigen::Vector3d& normal : problem.normals())
  {
    Estimate estimate;
    Selection selection;
    if (!robustStart(problem, odometry, params, normal, estimate, selection.poses))
    {
      continue;
    }
    selection.legs = legsBetween(selection.poses, odometry, params);
    const double cost = costOf(problem, selection.legs, estimate);
    if (cost < least)
    {
      least = cost;
      best = estimate;
      used = selection.poses;
    }
  }
  return std::isfinite(least);
}

std::vector<MountResidual> residualsOf(const Problem& problem, const Estimate& estimate, const Selection& selection,
                                       const std::vector<PlanarPose>& odometry)
{
  std::vector<MountResidual> residuals;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    Eigen::VectorXd errors;
    MountResidual residual;
    residual.used = std::find(selection.poses.begin(), selection.poses.end(), i) != selection.poses.end();
    const bool seen = problem.errors(estimate.state, i, inSpace(estimate.bases[i]).inverse(), errors);
    residual.pixels = seen ? std::sqrt(errors.squaredNorm() / hand_eye::CORNERS) : hand_eye::ENDLESS;
    const auto after = std::lower_bound(selection.poses.begin(), selection.poses.end(), i);
    if (after != selection.poses.begin())
    {
      const std::size_t last = *(after - 1);
      const PlanarPose by_images = compose(inverse(estimate.bases[last]), estimate.bases[i]);
      const PlanarPose by_odometry = compose(inverse(odometry[last]), odometry[i]);
      residual.way = std::hypot(by_images.x - by_odometry.x, by_images.y - by_odometry.y);
      residual.turn = std::abs(wrapAngle(by_images.yaw - by_odometry.yaw));
    }
    residuals.push_back(residual);
  }
  for (const Leg& leg : selection.refused)
  {
    residuals[leg.to].odometry_used = false;
  }
  return residuals;
}

/** Fills in what was estimated, and how uncertain that is, but for the camera's height. */
void fillEstimate(const Estimate& estimate, const Selection& selection, const MountParams& params, MountResult& result)
{
  const hand_eye::State& state = estimate.state;
  result.camera_in_base = state.camera_in_flange;
  result.view_in_odom = state.view_in_base;
  result.normal = state.normal;
  result.distance = state.distance;
  result.distance_sigma = state.distance * std::sqrt(selection.covariance(DISTANCE, DISTANCE));
  result.image_error = selection.sigmas.image;
  result.way_error = selection.sigmas.legs[WAY] * params.way_noise;
  result.turn_error = selection.sigmas.legs[TURN] * params.turn_noise;
  constexpr int FROM[] = { 0, 1, 3, 4, 5 };  // of the first unknowns in HandEyeResult's order
  for (int row = 0; row < 5; ++row)
  {
    for (int column = 0; column < 5; ++column)
    {
      result.covariance(FROM[row], FROM[column]) = selection.covariance(row, column);
    }
  }
}

/** Sets the height of camera and view. @return empty, or why it is not known. */
std::string fillHeight(const std::vector<HandEyePose>& poses, const Selection& selection, const MountParams& params,
                       MountResult& result)
{
  constexpr double LEVEL = 0.07;  // angle up to which a plane may be the floor [rad]
  const Eigen::Vector3d down = -result.view_in_odom.linear().transpose().col(2);
  const double incline = std::acos(std::clamp(down.dot(result.normal), -1.0, 1.0));
  const double base_height = poses.front().flange_in_base.translation().z();
  double height = params.height;
  if (params.sees_floor)
  {
    if (incline > LEVEL)
    {
      return "the view's plane is not the floor: it is inclined by " + hand_eye::rounded(DEGREES * incline) +
             " degrees; store a view of the floor, or tell the camera's height";
    }
    // The distance is that of the camera that took the view, which was as much higher as the images say.
    height = result.distance - result.view_in_odom.translation().z() - base_height;
    const Eigen::VectorXd with =
        result.distance * selection.covariance.col(DISTANCE) - selection.covariance.col(VIEW_HEIGHT);
    result.covariance(2, 2) = result.distance * with(DISTANCE) - with(VIEW_HEIGHT);
    constexpr int TO[] = { 0, 1, 3, 4, 5 };
    for (int row = 0; row < 5; ++row)
    {
      result.covariance(TO[row], 2) = with(row);
      result.covariance(2, TO[row]) = with(row);
    }
  }
  else if (std::isnan(height))
  {
    return std::string(
               "how high the camera is does not show while a base drives on a floor: measure its height above the "
               "base's frame, and tell it") +
           (incline <= LEVEL ? "; or, as the view's plane is level, say that it is the floor, if it is" : "");
  }
  else
  {
    result.covariance(2, 2) = params.height_sigma * params.height_sigma;
  }
  result.camera_in_base.translation().z() = height;
  result.view_in_odom.translation().z() += height + base_height;
  return "";
}

/** The motion of the poses that were used. */
MountMotion motionOfUsed(const HandEyeView& view, const std::vector<HandEyePose>& poses, const Indices& used,
                         const Eigen::Vector3d& normal)
{
  std::vector<HandEyePose> chosen;
  for (const std::size_t i : used)
  {
    chosen.push_back(poses[i]);
  }
  return mount::motionOf(Problem(view, chosen, hand_eye::NONE), chosen, normal);
}

void checkMount(const MountParams& params)
{
  if (!std::isnan(params.height) && !std::isfinite(params.height))
  {
    throw std::invalid_argument("the height of the camera has to be a finite number");
  }
  if (!(params.way_noise > 0.0) || !(params.turn_noise > 0.0))
  {
    throw std::invalid_argument("the errors of odometry have to be above 0");
  }
}

}  // namespace
}  // namespace mount

double MountResult::translationSigma() const
{
  Eigen::Matrix3d on_floor = Eigen::Matrix3d::Zero();
  on_floor.topLeftCorner<2, 2>() = covariance.topLeftCorner<2, 2>();
  return std::sqrt(std::max(0.0, singularValues(on_floor).values(0)));
}

double MountResult::rotationSigma() const
{
  return std::sqrt(std::max(0.0, singularValues(covariance.bottomRightCorner<3, 3>()).values(0)));
}

double MountResult::heightSigma() const
{
  return std::sqrt(covariance(2, 2));
}

MountResult calibrateMount(const HandEyeView& view, const std::vector<HandEyePose>& poses, const MountParams& params)
{
  hand_eye::check(view, poses);
  mount::checkMount(params);
  const mount::Problem problem(view, poses, hand_eye::NONE);
  MountResult result;
  result.residuals.resize(poses.size());
  result.message = mount::offTheFloor(poses);
  if (!result.message.empty())
  {
    return result;
  }
  result.motion = mount::motionOf(problem, poses, Eigen::Vector3d::Constant(hand_eye::NONE));
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion: " + join(result.missing, "; ");
    return result;
  }

  std::vector<PlanarPose> odometry;
  odometry.reserve(poses.size());
  for (const HandEyePose& pose : poses)
  {
    odometry.push_back(toPlanar(pose.flange_in_base));
  }
  mount::Estimate estimate;
  mount::Selection selection;
  if (!mount::bestStart(problem, odometry, params, estimate, selection.poses))
  {
    result.message =
        "the motions of base and images do not fit one another for any mounting of the camera; check that the "
        "frames are right";
    return result;
  }
  result.message = mount::refine(problem, odometry, params, estimate, selection);
  result.residuals = mount::residualsOf(problem, estimate, selection, odometry);
  if (!result.message.empty())
  {
    return result;
  }

  mount::fillEstimate(estimate, selection, params, result);
  result.motion = mount::motionOfUsed(view, poses, selection.poses, estimate.state.normal);
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion, without the poses that disagree: " + join(result.missing, "; ");
    return result;
  }
  if (!(result.translationSigma() <= params.max_translation_sigma) ||
      !(result.rotationSigma() <= params.max_rotation_sigma))
  {
    result.missing.push_back(
        "the result is uncertain by " + hand_eye::rounded(1e3 * result.translationSigma()) + " mm and " +
        hand_eye::rounded(DEGREES * result.rotationSigma(), 2) +
        " degrees (standard deviation): add turns on the spot and straight ways, and let the base stand "
        "after each of them");
    result.message = result.missing.back();
    return result;
  }
  result.message = mount::fillHeight(poses, selection, params, result);
  if (!result.message.empty())
  {
    result.missing.push_back(result.message);
    return result;
  }
  result.found = true;
  return result;
}

}  // namespace view_servo
