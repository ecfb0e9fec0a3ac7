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
  bool differential = false;           ///< it cannot slide: a velocity to the side is not carried out
  double max_speed = 0.5;              ///< [m/s]
  double max_turn_rate = 1.0;          ///< [rad/s]
  double max_acceleration = 1.0;       ///< [m/s²]
  double max_turn_acceleration = 2.0;  ///< [rad/s²]
  double radius = 0.26;                ///< of its round outline on the floor [m]
  double odometry_drift = 0.0;         ///< part by which odometry measures distances too long
  double odometry_turn_scale = 1.0;    ///< measured turn over true turn; above 1 where wheels skid
  double deadband_speed = 0.0;         ///< slower commands do not move it [m/s]
  double deadband_turn_rate = 0.0;     ///< slower commands do not turn it [rad/s]
  double odometry_turn_drift = 0.0;    ///< turn that odometry adds, by the way driven [rad/m]
  double odometry_noise = 0.0;         ///< standard deviation of the motion measured in 20 ms, as a part of it
  double slip_share = 0.0;             ///< share of the time in which the wheels slip, for short spells; [0, 1)
  double slip_loss = 0.5;              ///< part of the wheels' motion that is lost while they slip; [0, 1]
  double slip_duration = 0.5;          ///< of a spell, in the mean [s]
  std::uint64_t seed = 1;              ///< of odometry's noise and of the spells

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(NomadParams& params);

/**
 * A base. By default it is holonomic like the Nomad 200, which moves in any direction without turning and turns without
 * moving. Its poses lie on the floor. Odometry measures how the wheels turn: while they slip, that is more than the
 * way.
 */
class Nomad
{
public:
  /** (v_x, v_y, turn rate) in `base_link` [m/s, m/s, rad/s]. */
  using Velocity = Eigen::Vector3d;

  /**
   * Starts at rest at the world's goal. The world must outlive the object.
   * @throws std::invalid_argument naming the parameters' faults, or an obstacle at the goal.
   */
  Nomad(const World& world, const NomadParams& params);

  /**
   * Puts the base there at once, at rest; its odometry does not change. Only x, y and yaw of the pose count.
   * @param pose world from base.
   * @throws std::invalid_argument when the pose is not finite, or naming an obstacle that stands there.
   */
  void setPose(const Eigen::Isometry3d& pose);

  /**
   * Sets the velocity to reach and keep from now on, as far as the limits allow.
   * @return false, and nothing changes, when it is not finite.
   */
  bool command(const Velocity& velocity);

  /** Stops at once, as by its brakes. */
  void halt();

  /** Simulates the next `dt` [s], > 0; an obstacle in the way stops the base. */
  void step(double dt);

  /** World from base. */
  Eigen::Isometry3d pose() const;
  /** World from the camera's optical frame. */
  Eigen::Isometry3d cameraPose() const;
  /** The velocity of the wheels: the true one, except while they slip. */
  const Velocity& velocity() const
  {
    return velocity_;
  }
  /** `odom` from base, as odometry has it: `odom` is where the base was when this object was made. */
  Eigen::Isometry3d odometry() const;
  /** The mean velocity of the last step, as odometry measured it. */
  const Velocity& measuredVelocity() const
  {
    return measured_;
  }
  /** The obstacle that stopped the base in the last step; empty when none did. */
  const std::string& blockedBy() const
  {
    return blocked_by_;
  }

private:
  /** The part of the wheels' motion in the next `dt` [s] that moves the base. */
  double grip(double dt);

  const World& world_;
  NomadParams params_;
  Rng rng_;
  Rng slip_rng_;              // of its own, so that odometry's noise is the same with and without slip
  bool slips_ = true;         // now; the first step ends that
  double grip_left_ = 0.0;    // until that changes [s]
  Eigen::Vector3d pose_;      // x, y, yaw in the world
  Eigen::Vector3d odometry_;  // the same in the odometry's frame
  Velocity velocity_ = Velocity::Zero();
  Velocity commanded_ = Velocity::Zero();
  Velocity measured_ = Velocity::Zero();
  std::string blocked_by_;
};

}  // namespace view_servo::sim
