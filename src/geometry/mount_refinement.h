// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "mount_problem.h"

#include <Eigen/Core>

#include <array>
#include <string>
#include <vector>

namespace view_servo::mount
{
/** What odometry says of legs: the places at the ends of ways, those at the ends of turns on the spot, and yaws. */
enum Part
{
  WAY,
  SPOT,
  TURN,
  PARTS
};

/** How large errors are. */
struct Sigmas
{
  double image = 0.3;                                      ///< of a corner's coordinate [px]
  std::array<double, PARTS> legs = { { 1.0, 1.0, 1.0 } };  ///< as multiples of Leg::way_sigma and turn_sigma
};

/** What is used of poses and odometry, and how uncertain an estimate is by that. */
struct Selection
{
  Indices poses;             ///< in ascending order
  std::vector<Leg> legs;     ///< between these poses
  std::vector<Leg> refused;  ///< likewise, but they contradict the images
  Sigmas sigmas;
  Eigen::MatrixXd covariance;  ///< of the estimate, its first SHARED unknowns first
};

/** Minimises the squared errors of what is selected, in standard deviations. */
void fit(const Problem& problem, const Selection& selection, Estimate& estimate);

/**
 * Squared errors of all poses and of the legs between `used`, none more than a large one, for the choice between
 * estimates.
 */
double costOf(const Problem& problem, const std::vector<Leg>& legs, Estimate& estimate);

/**
 * Refines an estimate by the poses and legs that agree. @param selection with the poses to begin with. @return empty,
 * or why the poses do not tell it.
 */
std::string refine(const Problem& problem, const std::vector<PlanarPose>& odometry, const MountParams& params,
                   Estimate& estimate, Selection& selection);

}  // namespace view_servo::mount
