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

/** Limits of the motion of a base or a camera. */
struct VelocityLimits
{
  double max_speed = 0.25;             ///< largest norm of the linear velocity [m/s]
  double max_turn_rate = 0.4;          ///< largest norm of the angular velocity [rad/s]
  double max_acceleration = 0.5;       ///< largest rate at which the linear velocity changes, but for a stop [m/s²]
  double max_turn_acceleration = 1.0;  ///< largest rate at which the angular velocity changes, but for a stop [rad/s²]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(VelocityLimits& params);

/** Default limits of a camera in an arm's hand. */
inline const VelocityLimits ARM_LIMITS{ 0.15, 0.6, 0.5, 2.0 };

/**
 * Keeps velocities within limits. Linear and angular part are scaled by one factor, so that their ratio stays, and each
 * change is limited in the same way, except that a stop is immediate. A velocity's first LINEAR components are a linear
 * velocity, the ANGULAR others a turn rate.
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

  /**
   * The velocity allowed `dt` [s] after the last one. A wanted velocity that is zero or not finite stops at once. With
   * a `dt` that is not above 0 the last velocity stays.
   */
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

  /** New limits, which must be valid; a velocity beyond them is brought within at once. */
  void setLimits(const VelocityLimits& limits)
  {
    limits_ = limits;
    velocity_ *= scaleWithin(velocity_, limits_.max_speed, limits_.max_turn_rate);
  }

  /** The velocity is zero at once, whatever the limits of acceleration. */
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
  Velocity velocity_ = Velocity::Zero();  // allowed last
};

using BaseVelocityLimiter = VelocityLimiter<2, 1>;
using TwistLimiter = VelocityLimiter<3, 3>;

}  // namespace view_servo
