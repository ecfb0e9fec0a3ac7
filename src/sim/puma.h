// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
struct PumaParams
{
  std::string base_link = "base_link";
  std::string camera_frame = "camera_optical_frame";  ///< x right, y down, z forward (REP 103)
  double max_joint_acceleration = 4.0;                ///< [rad/s²], > 0
  double damping = 0.05;                              ///< of the inverse at a singularity, >= 0
  double min_manipulability = 0.02;  ///< smallest singular value of the Jacobian below which it slows down, > 0
  double encoder_noise = 0.0;        ///< sd of each reading [rad], >= 0
  double hand_eye_translation_error =
      0.0;  ///< of the true camera from where the URDF says, in a seeded direction [m], >= 0
  double hand_eye_rotation_error = 0.0;  ///< about a seeded axis [rad], in [0, π]
  std::uint64_t seed = 1;

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/**
 * A Puma 560 that follows velocities of its camera: kinematics of a URDF by KDL, velocities by damped least squares,
 * scaled so that no joint exceeds its velocity limit, and stopped at the joints' ends. Six revolute joints.
 * Limits slow the camera down on its path. It leaves the path only where the joints cannot brake as fast as the path
 * turns: fast ones, near the wrist's singularity, and at a sudden change of the twist.
 *
 * Its own control is ideal but for the calibration: it knows the joint angles without noise and the camera where the
 * URDF has it. The true camera is elsewhere by the hand-eye error, which is constant. Not for several threads at once.
 */
class Puma
{
public:
  static constexpr int JOINTS = 6;
  using Joints = Eigen::Matrix<double, JOINTS, 1>;
  using Twist = Eigen::Matrix<double, 6, 1>;  ///< [v; ω] of the camera in its optical frame [m/s, rad/s]

  enum class State
  {
    STILL,             ///< no twist to follow, and at rest
    MOVING,            ///< follows the twist, perhaps slowed by a velocity limit; or comes to rest
    NEAR_SINGULARITY,  ///< slowed down
    AT_LIMIT           ///< a joint's end keeps it from following: it slows down or stands
  };

  /**
   * At rest with all joints 0, or at the nearest limit.
   * @throws std::invalid_argument naming the parameters' faults or what the URDF lacks.
   */
  Puma(const std::string& urdf_xml, const PumaParams& params);
  ~Puma();

  /** From the base to the camera. */
  const std::vector<std::string>& jointNames() const;

  /**
   * Puts the arm there, at rest and with no twist to follow.
   * @throws std::invalid_argument naming a joint beyond its limits or not finite.
   */
  void setJoints(const Joints& joints);
  /**
   * Puts the camera (the true one) there, at rest and with no twist to follow. Searches for joint angles from the
   * present ones and from fixed starts, and takes the solution nearest to the present ones.
   * @param camera base_link from optical frame.
   * @return false, and nothing changes, when it is out of reach (within 1e-6 m and rad) or no pose.
   */
  bool setCameraPose(const Eigen::Isometry3d& camera);

  /**
   * The twist to follow from now on, of the camera where the URDF has it.
   * @return false, and the former one stays, when it is not finite.
   */
  bool command(const Twist& twist);
  /** Stands still at once, by its brakes, with no twist to follow. */
  void halt();
  /**
   * Moves on by `dt` [s], in parts of 2 ms at most. Accelerations are limited, also when it stops.
   * @throws std::invalid_argument unless `dt` lies in (0, 60].
   */
  void step(double dt);

  /** True joint angles [rad] and velocities [rad/s]. */
  const Joints& joints() const;
  const Joints& velocities() const;
  /** What the encoders read now: with noise, new at every call. */
  Joints measuredJoints();
  /** base_link from the true camera's optical frame. */
  Eigen::Isometry3d cameraPose() const;
  /** base_link from the optical frame as the URDF has it, for any joints. */
  Eigen::Isometry3d nominalCameraPose(const Joints& joints) const;

  /** As of the last step. */
  State state() const;
  /** What the state is about, for instance which joint is at its end; empty when there is nothing to say. */
  const std::string& message() const;

private:
  struct Kinematics;

  void rest(const Joints& joints);
  void advance(double dt);

  PumaParams params_;
  std::unique_ptr<Kinematics> kinematics_;
  Rng rng_;
  Eigen::Isometry3d nominal_from_true_camera_;
  Joints joints_;
  Joints velocities_;
  Twist twist_;
  State state_ = State::STILL;
  std::string message_;
};

}  // namespace view_servo::sim
