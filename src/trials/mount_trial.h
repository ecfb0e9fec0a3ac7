// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/nomad.h"
#include "sim/renderer.h"
#include "sim/world.h"
#include "view_servo/geometry/mount_calibration.h"
#include "view_servo/robust/random.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/types.hpp>

#include <cstdint>
#include <memory>
#include <optional>

namespace view_servo::sim
{
struct MountTrialParams
{
  double image_noise = 2.0;     ///< standard deviation [grey levels]
  double odometry_noise = 0.1;  ///< of what odometry measures in 20 ms, as a part of it
  double odometry_turn_error =
      0.02;  ///< of turns that odometry measures too large, as a part of them; drawn for each trial
  double odometry_turn_drift = 0.02;  ///< of turns that odometry adds to ways [rad/m]; drawn for each trial
  int poses = 20;                     ///< that the calibration is made of
  std::uint64_t seed = 1;             ///< of all noise, of the mounting, and of how the base is driven
};

/**
 * Calibration of the mounting of the simulated base's camera before the photo on the desk world's wall. The camera is
 * mounted at random: up to 20 cm from the base's middle, turned by up to 8 degrees to the side, 3 about its axis, and 7
 * to 13 upwards. The base turns on the spot and drives straight ahead or back in turn, as a differential one does, and
 * stands after each, where the view is found, followed and averaged as homography_tracker and calibrate_mount do.
 */
class MountTrial
{
public:
  /**
   * @param world the desk world. @throws std::runtime_error when it has no photo, and as SimulatedCamera and Nomad do.
   */
  MountTrial(const World& world, const MountTrialParams& params);

  /** Drives and calibrates, with the true height of the camera. @throws what calibrateMount() throws. */
  MountResult run();

  /** The base from the true camera's optical frame. */
  const Eigen::Isometry3d& truth() const
  {
    return world_.camera_on_base;
  }

private:
  void drive(double speed, double turn_rate, double duration);
  std::optional<Eigen::Matrix3d> look();

  MountTrialParams params_;
  Rng rng_;
  World world_;
  SimulatedCamera camera_;
  Nomad nomad_;
  PlaneFinder finder_;
  cv::Rect region_;  // of the view, which shows the photo only [px]
  std::shared_ptr<const PreparedImage> view_;
};

}  // namespace view_servo::sim
