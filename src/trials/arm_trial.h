// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/puma.h"
#include "sim/world.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/tracking/plane_tracker.h"

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** What makes servoing harder. */
struct ArmConditions
{
  double image_noise = -1.0;                ///< sd [grey levels]; negative: the world's
  Light light;                              ///< while it servos; the view is stored under the world's
  std::vector<std::string> groups;          ///< of things that were not there when the view was stored
  double encoder_noise = 0.0;               ///< sd of each reading [rad]
  double hand_eye_translation_error = 0.0;  ///< [m]
  double hand_eye_rotation_error = 0.0;     ///< [rad]
  double focal_length_error = 0.0;          ///< of the calibration, as a part of it
  double covered_from = -1.0;               ///< when something covers the camera, for 2 s [s]; negative: nothing does
};

struct ArmTrialParams
{
  PlaneTrackerParams tracker;
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;
  ArmConditions conditions;
  double control_period = 0.02;  ///< [s]
  double image_delay = 0.05;     ///< from an image's stamp until servoing knows what it says [s]
  double matching_time = 0.3;    ///< that passes until the view is found by its points [s]
  double max_duration = 40.0;    ///< [s]
  std::uint64_t seed = 1;
};

/** What happened with an image, for plots and checks. */
struct ArmStep
{
  double time = 0.0;  ///< of the image [s]
  cv::Mat image;
  Eigen::Isometry3d camera;  ///< the true one, in the world
  PlaneTrack track;
  ServoReport report;  ///< when it was taken, as of the images before
  Twist sent;          ///< likewise
};

struct ArmOutcome
{
  bool converged = false;          ///< says servoing
  std::string reason;              ///< why it ended
  double translation_error = 0.0;  ///< true one, at the end [m]
  double rotation_error = 0.0;     ///< likewise [rad]
  double duration = 0.0;           ///< [s]
};

/**
 * 2.5D servoing in a simulated world, in one process and as fast as it can: image, matching, tracking, servoing, limits,
 * arm, with the same classes that the nodes use and the delays that they have. The view is stored at the world's goal,
 * with the world's region of interest.
 */
class ArmTrials
{
public:
  /** For arm worlds. @param urdf_xml of the arm. @throws what SimulatedCamera, Puma and PlaneTracker throw. */
  ArmTrials(const World& world, const std::string& urdf_xml, const ArmTrialParams& params);
  ~ArmTrials();

  /**
   * @param start of the camera, in the world. @param on_step called for each image, may be empty.
   * @throws std::invalid_argument when the camera cannot be brought there.
   */
  ArmOutcome run(const Eigen::Isometry3d& start, const std::function<void(const ArmStep&)>& on_step = {});

private:
  struct Parts;

  World world_;
  std::string urdf_xml_;
  ArmTrialParams params_;
  std::unique_ptr<Parts> parts_;
};

}  // namespace view_servo::sim
