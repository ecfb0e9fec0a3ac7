// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace view_servo
{
/** @file
 * Homographies near the identity, as a change I + [p0 p1 p2; p3 p4 p5; p6 p7 0] in centred coordinates.
 */

using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Vector8 = Eigen::Matrix<double, 8, 1>;

/** Coordinates about the middle of some points and of the order of 1: x = (pixel - middle) / spread. */
struct Centring
{
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();  ///< mean of the points [px]
  double spread = 1.0;                               ///< their distance from it, roughly: the unit of x [px], > 0

  Eigen::Vector2d apply(const Eigen::Vector2d& pixel) const
  {
    return (pixel - middle) / spread;
  }
};

/** Derivative of where a change sends a centred place, by p0 to p7, at p = 0. */
Eigen::Matrix<double, 2, 8> shiftByChange(const Eigen::Vector2d& x);

/** The change that solves `normal` p = `right`, as a homography of pixels; empty when the equations are singular. */
std::optional<Eigen::Matrix3d> solveChange(const Matrix8& normal, const Vector8& right, const Centring& centring);

/**
 * The homography near the identity that explains shifts of points, each with its information; by least squares, with
 * Tukey's weights for the residuals.
 */
class ShiftFit
{
public:
  /** @param width residual from which on a shift no longer counts [px]. */
  explicit ShiftFit(double width) : width_(width)
  {
  }

  /** The point at `at` moves to `at + shift` [px]. @param information inverse covariance of the shift [1/px²]. */
  void add(const Eigen::Vector2d& at, const Eigen::Vector2d& shift, const Eigen::Matrix2d& information);

  /** The fit to all shifts added; empty when they do not determine it. */
  std::optional<Eigen::Matrix3d> solve() const;

  /**
   * The points `at` whose shifts a fit explains to within `max_residual` [px].
   * @param rms is set to the root mean square of their residuals [px], 0 when there are none.
   */
  Points supporting(const Eigen::Matrix3d& fitted, double max_residual, double& rms) const;

private:
  struct Shift
  {
    Eigen::Vector2d at;
    Eigen::Vector2d shift;
    Eigen::Matrix2d information;
  };

  std::optional<Centring> centring() const;

  double width_;
  std::vector<Shift> shifts_;
};

}  // namespace view_servo
