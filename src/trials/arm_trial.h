// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/puma.h"
#include "sim/world.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/target_tracker.h"

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** What makes servoing harder. The defaults add nothing. */
struct ArmConditions
{
  double image_noise = -1.0;                ///< standard deviation [grey levels]; negative: the world's
  Light light;                              ///< while the arm servos; the view is stored under the world's light
  std::vector<std::string> groups;          ///< of surfaces that were not there when the view was stored
  double encoder_noise = 0.0;               ///< standard deviation of each reading [rad]
  double hand_eye_translation_error = 0.0;  ///< how far the camera's true place on the hand is from the URDF's [m]
  double hand_eye_rotation_error = 0.0;     ///< angle between its true orientation and the URDF's [rad]
  /**
   * Where a calibration has the camera, in the optical frame of the arm's description. Tracking and servoing take it
   * for the camera's frame; empty: they take the description's.
   */
  std::optional<Eigen::Isometry3d> calibrated_camera;
  double focal_length_error = 0.0;  ///< part by which the calibration's focal lengths are too long
  double covered_from = -1.0;       ///< when something covers the camera for 2 s [s]; negative: never
};

/** Options of ArmTrials. */
struct ArmTrialParams
{
  PlaneTrackerParams tracker;
  Target target = Target::PLANE;  ///< what the view is taken to show
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;
  ArmConditions conditions;
  double control_period = 0.02;  ///< time from one command to the next [s]
  double image_delay = 0.05;     ///< from an image's stamp until servoing gets what tracking makes of it [s]
  double matching_time = 0.3;  ///< from an image's stamp until tracking gets where the view is in it by its points [s]
  double max_duration = 40.0;  ///< after which a run is given up [s]
  std::uint64_t seed = 1;      ///< of all noise, and of the hand-eye error's directions
};

/** The state when an image is taken, with what tracking makes of it. */
struct ArmStep
{
  double time = 0.0;  ///< since the start [s]
  cv::Mat image;
  Eigen::Isometry3d camera;  ///< world from the true camera
  PlaneTrack track;          ///< with this image
  ServoReport report;        ///< without this image, which servoing gets later
  Twist sent;                ///< last command, in the camera's frame [m/s, rad/s]
};

/** How a run ended. */
struct ArmOutcome
{
  bool converged = false;          ///< what servoing says, if no joint came to its end
  std::string reason;              ///< why the run ended
  double translation_error = 0.0;  ///< true distance of the camera from the goal at the end [m]
  double rotation_error = 0.0;     ///< true angle between the two at the end [rad]
  double duration = 0.0;           ///< until servoing ended [s]
};

/**
 * Runs of 2.5D servoing in a simulated world, in one process and as fast as it can: images, matching, tracking,
 * servoing, velocity limits and the arm, with the same classes that the nodes use and with the delays that the nodes
 * have. The view is stored at the world's goal, with the world's region of interest.
 */
class ArmTrials
{
public:
  /** @param world of the arm. @param urdf_xml of the arm. @throws what SimulatedCamera throws. */
  ArmTrials(const World& world, const std::string& urdf_xml, const ArmTrialParams& params);
  ~ArmTrials();

  /**
   * @param start world from the camera's optical frame.
   * @param on_step is called for each image; may be empty.
   * @throws std::invalid_argument when the arm cannot bring its camera to the start or the goal, or what Puma and
   * PlaneTracker throw.
   */
  ArmOutcome run(const Eigen::Isometry3d& start, const std::function<void(const ArmStep&)>& on_step = {});

private:
  struct Parts;
  class Run;

  World world_;
  std::string urdf_xml_;
  ArmTrialParams params_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace view_servo::sim
