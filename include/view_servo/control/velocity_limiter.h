// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo
{
/** A base's velocity: (v_x, v_y, turn rate) in base_link [m/s, m/s, rad/s]. */
using BaseVelocity = Eigen::Vector3d;

/** What a base may do. */
struct BaseLimits
{
  double max_speed = 0.25;             ///< [m/s], > 0
  double max_turn_rate = 0.4;          ///< [rad/s], > 0
  double max_acceleration = 0.5;       ///< [m/s²], > 0
  double max_turn_acceleration = 1.0;  ///< [rad/s²], > 0

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Keeps commands within limits: the whole velocity is scaled, so that its direction stays, and changes gradually. */
class VelocityLimiter
{
public:
  /** The limits must be valid. */
  explicit VelocityLimiter(const BaseLimits& limits) : limits_(limits)
  {
  }

  /** The velocity allowed after `dt` [s] on the way to the one wanted. Not finite: zero. */
  BaseVelocity next(const BaseVelocity& wanted, double dt);

  /** Zero at once. */
  void stop()
  {
    velocity_.setZero();
  }

private:
  BaseLimits limits_;
  BaseVelocity velocity_ = BaseVelocity::Zero();
};

}  // namespace view_servo
