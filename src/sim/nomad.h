// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/random.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** Options of the simulated base. */
struct NomadParams
{
  double max_speed = 0.5;              ///< [m/s], > 0
  double max_turn_rate = 1.0;          ///< [rad/s], > 0
  double max_acceleration = 1.0;       ///< [m/s²], > 0
  double max_turn_acceleration = 2.0;  ///< [rad/s²], > 0
  double radius = 0.26;                ///< of its outline on the floor [m], > 0
  double odometry_drift = 0.0;         ///< distance measured too long, as a part of it, > -1
  double odometry_turn_drift = 0.0;    ///< turn that odometry adds [rad/m]
  double odometry_noise = 0.0;         ///< sd of the measured motion, as a part of it, >= 0
  std::uint64_t seed = 1;

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(NomadParams& params);

/**
 * A holonomic base like the Nomad 200: it moves in any direction without turning, and turns. Poses are on the floor.
 */
class Nomad
{
public:
  /** (v_x, v_y, turn rate) in the base's frame [m/s, m/s, rad/s]. */
  using Velocity = Eigen::Vector3d;

  /** Starts at the world's goal. @throws std::invalid_argument naming the parameters' faults. */
  Nomad(const World& world, const NomadParams& params);

  /**
   * Puts the base there, at rest; odometry does not notice. Only x, y and yaw count.
   * @throws std::invalid_argument when it is not finite or an obstacle, which is named, stands there.
   */
  void setPose(const Eigen::Isometry3d& pose);

  /** What to do from now on, as far as the limits allow. @return false, and nothing changes, when it is not finite. */
  bool command(const Velocity& velocity);

  /** Stands still at once, by its brakes. */
  void halt();

  /** Moves on by `dt` [s], > 0; obstacles stop it. */
  void step(double dt);

  /** World from base. */
  Eigen::Isometry3d pose() const;
  /** World from the camera's optical frame. */
  Eigen::Isometry3d cameraPose() const;
  const Velocity& velocity() const
  {
    return velocity_;
  }
  /** Where odometry thinks the base is, from where it was when this object was made. */
  Eigen::Isometry3d odometry() const;
  /** What odometry measured over the last step. */
  const Velocity& measuredVelocity() const
  {
    return measured_;
  }
  /** The obstacle that the base pushes against; empty: none. */
  const std::string& blockedBy() const
  {
    return blocked_by_;
  }

private:
  const World& world_;
  NomadParams params_;
  Rng rng_;
  Eigen::Vector3d pose_;      // x, y, yaw in the world
  Eigen::Vector3d odometry_;  // the same in the odometry's frame
  Velocity velocity_ = Velocity::Zero();
  Velocity commanded_ = Velocity::Zero();
  Velocity measured_ = Velocity::Zero();
  std::string blocked_by_;
};

}  // namespace view_servo::sim
