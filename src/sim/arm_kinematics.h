// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** Which chain of a URDF is the arm, and how its kinematics is inverted near singularities. */
struct ArmKinematicsParams
{
  std::string base_link = "base_link";
  std::string camera_frame = "camera_optical_frame";  ///< x right, y down, z forward (REP 103)
  double damping = 0.05;                              ///< damping of the least squares at a singularity, > 0
  double min_manipulability = 0.02;                   ///< smallest singular value of the Jacobian that needs no damping

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/**
 * The kinematics of an arm with six revolute joints that carries a camera, as its URDF has it: poses, inverse
 * kinematics, and joint velocities for a twist of the camera, with what the joints' limits leave of them. It has no
 * state.
 *
 * Poses are those of the camera's optical frame in `base_link`. Twists are those of the camera, in its optical frame.
 */
class ArmKinematics
{
public:
  static constexpr int JOINTS = 6;
  using Joints = Eigen::Matrix<double, JOINTS, 1>;    ///< in the order from base to camera: [rad] or [rad/s]
  using Twist = Eigen::Matrix<double, 6, 1>;          ///< [v; ω] [m/s, rad/s]
  using Jacobian = Eigen::Matrix<double, 6, JOINTS>;  ///< joint velocities -> twist

  /** The factor in [0, 1] by which a limit slows all joints down alike, and the joint whose limit it is. */
  struct Slowdown
  {
    double factor = 1.0;
    int joint = 0;  ///< without meaning when the factor is 1
  };

  /** Joint velocities that follow a twist. */
  struct Following
  {
    Joints velocities;
    double manipulability;  ///< smallest singular value of the Jacobian
  };

  /** @throws std::invalid_argument naming the parameters' faults or what the URDF lacks. */
  ArmKinematics(const std::string& urdf_xml, const ArmKinematicsParams& params);
  ~ArmKinematics();

  /** Names of the joints in the order from the base to the camera. */
  const std::vector<std::string>& jointNames() const
  {
    return names_;
  }
  /** Lower ends of the joints [rad]. */
  const Joints& lower() const
  {
    return lower_;
  }
  /** Upper ends of the joints [rad]. */
  const Joints& upper() const
  {
    return upper_;
  }

  /** base_link from the optical frame. */
  Eigen::Isometry3d pose(const Joints& joints) const;

  /** The Jacobian at joint angles [rad]: joint velocities -> twist of the camera. */
  Jacobian jacobian(const Joints& joints) const;

  /**
   * Joint angles within their limits that bring the camera to a pose, within 1e-6 m and rad. The search starts at
   * `near` and at fixed angles that are spread over the joints' ranges; of the solutions found, the nearest to `near`
   * is returned.
   * @param goal base_link from the optical frame.
   * @return empty when the pose is out of reach, or its rotation is none.
   */
  std::optional<Joints> inverse(const Eigen::Isometry3d& goal, const Joints& near) const;

  /**
   * Joint velocities for a twist, by damped least squares: without damping while the smallest singular value of the
   * Jacobian is at least `min_manipulability`, with damping that grows smoothly to `damping` as that value falls to 0.
   */
  Following follow(const Joints& joints, const Twist& twist) const;

  /** What the URDF's velocity limits leave of joint velocities. */
  Slowdown withinVelocityLimits(const Joints& velocities) const;

  /**
   * What is left of joint velocities so that the arm can keep them for `dt` [s] and can still stop before any joint's
   * end afterwards. While it stops, all joints slow down in proportion, the fastest one with `acceleration` [rad/s²].
   */
  Slowdown beforeEnds(const Joints& joints, const Joints& velocities, double dt, double acceleration) const;

  /**
   * The joint velocities that can be reached from `velocities` within `dt` [s], when no joint accelerates by more than
   * `acceleration` [rad/s²]: `wanted`, or as large a part of it as possible, which keeps the camera on its path. When
   * no part of it can be reached, the velocities change towards the nearest part, but not so far that a joint could no
   * longer stop before its end.
   * @param wanted passes beforeEnds() unchanged, as `velocities` did when they were chosen; then braking always
   * suffices.
   */
  Joints accelerate(const Joints& joints, const Joints& velocities, const Joints& wanted, double dt,
                    double acceleration) const;

private:
  struct Chain;  // of KDL

  Joints improve(Joints joints, const Eigen::Isometry3d& goal) const;
  Joints nearestTurns(const Joints& joints, const Joints& near) const;

  ArmKinematicsParams params_;
  std::unique_ptr<const Chain> chain_;
  std::vector<std::string> names_;
  Joints lower_;
  Joints upper_;
  Joints max_velocity_;  // [rad/s]
};

}  // namespace view_servo::sim
