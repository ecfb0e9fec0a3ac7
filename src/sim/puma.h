// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/arm_kinematics.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/random.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** Options of the simulated arm. */
struct PumaParams : ArmKinematicsParams
{
  double max_joint_acceleration = 4.0;      ///< [rad/s²]
  double encoder_noise = 0.0;               ///< standard deviation of each reading [rad]
  double hand_eye_translation_error = 0.0;  ///< how far the true camera is from where the URDF has it [m]
  double hand_eye_rotation_error = 0.0;     ///< by what angle it is turned against the URDF [rad]
  std::uint64_t seed = 1;                   ///< of the encoders' noise, and of the hand-eye error's directions

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of those of these parameters that are not the kinematics'. */
std::vector<Parameter> parameters(PumaParams& params);

/**
 * A Puma 560 that follows twists of its camera. ArmKinematics turns them into joint velocities, which are scaled down
 * so that no joint exceeds its velocity limit or runs into its end. Such limits slow the camera down on its path. It
 * leaves the path only where the joints cannot brake as fast as the path turns: at high speed, near a singularity of
 * the wrist, and when the twist changes suddenly.
 *
 * The arm controls itself by the true joint angles, without noise, but believes the camera to be where the URDF has it.
 * The true camera is off by the constant hand-eye error. An object must not be used by several threads at once.
 */
class Puma
{
public:
  static constexpr int JOINTS = ArmKinematics::JOINTS;
  using Joints = ArmKinematics::Joints;
  using Twist = ArmKinematics::Twist;  ///< of the camera in its optical frame, [v; ω] [m/s, rad/s]

  enum class State
  {
    STILL,             ///< at rest, with no twist to follow
    MOVING,            ///< follows the twist, perhaps slowed down by a velocity limit; or is coming to rest
    NEAR_SINGULARITY,  ///< follows more slowly than commanded, as the Jacobian is nearly singular
    AT_LIMIT           ///< slows down or stands, as a joint is at its end
  };

  /**
   * Starts at rest with all joints at 0, or at the limit nearest to 0.
   * @throws std::invalid_argument naming the parameters' faults or what the URDF lacks.
   */
  Puma(const std::string& urdf_xml, const PumaParams& params);

  /** Names of the joints in the order from the base to the camera. */
  const std::vector<std::string>& jointNames() const;

  /**
   * Puts the arm there at once, at rest and with no twist to follow.
   * @throws std::invalid_argument naming the joints that are beyond their limits or not finite.
   */
  void setJoints(const Joints& joints);
  /**
   * Puts the true camera there at once, at rest and with no twist to follow. Of the joint angles that do so, those that
   * ArmKinematics::inverse() finds nearest to the present ones are taken.
   * @param camera base_link from optical frame.
   * @return false, and nothing changes, when the pose is out of reach or not a finite rigid motion.
   */
  bool setCameraPose(const Eigen::Isometry3d& camera);

  /**
   * Sets the twist to follow from now on: that of the camera where the URDF has it.
   * @return false, and the arm goes on following the former twist, when this one is not finite.
   */
  bool command(const Twist& twist);
  /** Stops at once, as by its brakes, with no twist to follow. */
  void halt();
  /**
   * Simulates the next `dt` [s], in parts of 2 ms at most. Accelerations are limited, also while the arm stops.
   * @throws std::invalid_argument unless `dt` lies in (0, 60].
   */
  void step(double dt);

  /** True joint angles [rad]. */
  const Joints& joints() const;
  /** True joint velocities [rad/s]. */
  const Joints& velocities() const;
  /** A reading of the encoders [rad], whose noise is new at every call. */
  Joints measuredJoints();
  /** base_link from the true camera's optical frame. */
  Eigen::Isometry3d cameraPose() const;
  /** base_link from the optical frame where the URDF has it, for any joint angles. */
  Eigen::Isometry3d nominalCameraPose(const Joints& joints) const;

  /** The state after the last step. */
  State state() const;
  /** The reason for the state, for instance which joint is at its end; may be empty. */
  const std::string& message() const;

private:
  void rest(const Joints& joints);
  void advance(double dt);

  PumaParams params_;
  std::unique_ptr<const ArmKinematics> kinematics_;
  Rng rng_;
  Eigen::Isometry3d nominal_from_true_camera_;
  Joints joints_;
  Joints velocities_;
  Twist twist_;
  State state_ = State::STILL;
  std::string message_;
};

}  // namespace view_servo::sim
