// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>

#include <algorithm>
#include <string>
#include <vector>

namespace view_servo
{
/** A base's velocity: (v_x, v_y, turn rate) in base_link [m/s, m/s, rad/s]. */
using BaseVelocity = Eigen::Vector3d;

/** A camera's velocity: [v; ω] in its optical frame [m/s, rad/s]. */
using Twist = Eigen::Matrix<double, 6, 1>;

/** What a base or a camera may do. */
struct VelocityLimits
{
  double max_speed = 0.25;             ///< [m/s], > 0
  double max_turn_rate = 0.4;          ///< [rad/s], > 0
  double max_acceleration = 0.5;       ///< [m/s²], > 0
  double max_turn_acceleration = 1.0;  ///< [rad/s²], > 0

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(VelocityLimits& params);

/** What a camera in an arm's hand may do, unless told otherwise. */
inline const VelocityLimits ARM_LIMITS{ 0.15, 0.6, 0.5, 2.0 };

/**
 * Keeps commands within limits: the whole velocity is scaled, so that its direction stays, and changes gradually. Its
 * first `LINEAR` numbers are a speed, the others, `ANGULAR` of them, a turn rate.
 */
template <int LINEAR, int ANGULAR>
class VelocityLimiter
{
public:
  using Velocity = Eigen::Matrix<double, LINEAR + ANGULAR, 1>;

  /** The limits must be valid. */
  explicit VelocityLimiter(const VelocityLimits& limits) : limits_(limits)
  {
  }

  /** The velocity allowed after `dt` [s] on the way to the one wanted. Zero, and what is not finite, stops at once. */
  Velocity next(const Velocity& wanted, double dt)
  {
    if (!wanted.allFinite() || wanted.isZero(0.0))
    {
      velocity_.setZero();
    }
    else if (dt > 0.0)
    {
      const Velocity allowed = scaleWithin(wanted, limits_.max_speed, limits_.max_turn_rate) * wanted;
      const Velocity change = allowed - velocity_;
      velocity_ += scaleWithin(change, dt * limits_.max_acceleration, dt * limits_.max_turn_acceleration) * change;
    }
    return velocity_;
  }

  /** Zero at once. */
  void stop()
  {
    velocity_.setZero();
  }

private:
  /** The factor that brings a velocity within limits, at most 1. */
  static double scaleWithin(const Velocity& velocity, double linear, double angular)
  {
    const double excess =
        std::max(velocity.template head<LINEAR>().norm() / linear, velocity.template tail<ANGULAR>().norm() / angular);
    return excess > 1.0 ? 1.0 / excess : 1.0;
  }

  VelocityLimits limits_;
  Velocity velocity_ = Velocity::Zero();
};

using BaseVelocityLimiter = VelocityLimiter<2, 1>;
using TwistLimiter = VelocityLimiter<3, 3>;

}  // namespace view_servo
