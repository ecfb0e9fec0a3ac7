// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/puma.h"
#include "sim/renderer.h"
#include "sim/world.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/robust/random.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace view_servo::sim
{
struct HandEyeTrialParams
{
  double image_noise = 2.0;                  ///< standard deviation [grey levels]
  double encoder_noise = 1e-4;               ///< of each reading [rad]
  double hand_eye_translation_error = 0.02;  ///< of the camera's place on the hand by the arm's description [m]
  double hand_eye_rotation_error = 3.0 * M_PI / 180.0;  ///< of its direction [rad]
  int poses = 12;                                       ///< that the calibration is made of
  std::uint64_t seed = 1;                               ///< of all noise, of the poses and of the error's directions
};

/**
 * Hand-eye calibration of the simulated arm from a stored view and poses drawn at random around the goal. The view is
 * found in the images, followed in them, and averaged while the arm stands, as homography_tracker and
 * calibrate_hand_eye do. For the same seed and errors the true camera is where ArmTrials has it.
 */
class HandEyeTrial
{
public:
  /**
   * @param world of the arm. @throws std::invalid_argument and std::runtime_error as SimulatedCamera and Puma do, and
   * when the view shows nothing.
   */
  HandEyeTrial(const World& world, const std::string& urdf_xml, const HandEyeTrialParams& params);

  /** Calibrates once more, from other poses. @throws what calibrateHandEye() throws. */
  HandEyeResult run();

  /** The flange from the true camera's optical frame. */
  const Eigen::Isometry3d& truth() const
  {
    return camera_in_flange_;
  }
  /** A camera's pose on the flange -> its pose in the optical frame that the arm's description has. */
  Eigen::Isometry3d inDescribedCamera(const Eigen::Isometry3d& camera_in_flange) const
  {
    return described_camera_in_flange_.inverse() * camera_in_flange;
  }

private:
  bool hold(const Eigen::Isometry3d& camera);
  Eigen::Isometry3d elsewhere();
  std::optional<HandEyePose> observe(const Eigen::Isometry3d& camera);

  HandEyeTrialParams params_;
  World world_;
  Rng rng_;
  SimulatedCamera camera_;
  Puma puma_;
  PlaneFinder finder_;
  std::shared_ptr<const PreparedImage> view_;
  Eigen::Isometry3d described_camera_in_flange_;
  Eigen::Isometry3d camera_in_flange_;
  Eigen::Vector3d middle_;  // of the view, in the world [m]
};

}  // namespace view_servo::sim
