// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/views/view_match.h"

#include <Eigen/Core>

#include <cstddef>
#include <optional>

namespace view_servo
{
/** How the camera moved from the reference to the current view, as far as matches of a scene with depth tell. */
struct SceneMotion
{
  RelativePose pose;  ///< X_cur = R X_ref + t, t of length 1, as its true length is not known
  /**
   * Of rotation [rad] and t, as covarianceOf() gives it. Matches that lie near each other err alike, which is allowed
   * for.
   */
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::size_t inliers = 0;  ///< matches that agree with the motion
};

/**
 * The motion between two calibrated cameras from the inliers of a match, by five points each and least squares (Nistér
 * 2004). Empty when the match is no fundamental matrix, as a plane leaves two motions, and when too few agree with one.
 * @param reference, current calibrations of the cameras that took the views, without a fault.
 * @throws std::invalid_argument with the fault of a camera.
 */
std::optional<SceneMotion> sceneMotion(const ViewMatch& match, const Camera& reference, const Camera& current);

}  // namespace view_servo
