// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/homing.h"
#include "view_servo/control/route_guide.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/readiness.h"

#include <filesystem>
#include <string>
#include <vector>

namespace view_servo
{
/** Parameters that all drivers have. */
struct DriverParams
{
  bool dry_run = false;                    ///< publishes commands on cmd_vel_dry, not on cmd_vel
  double timeout = 60.0;                   ///< a goal that asks for none ends after this time [s]
  double control_rate = 50.0;              ///< how often commands are sent [Hz]
  double start_patience = START_PATIENCE;  ///< how long a goal waits for what it needs before it drives [s]
};

/** Names, units, ranges and meanings of these parameters, here and below. */
std::vector<Parameter> parameters(DriverParams& params);

/** Parameters of the node homing. */
struct HomingDriverParams
{
  DriverParams node;
  CameraInputParams camera;
  std::filesystem::path views_dir;  ///< directory of the stored views; empty: as viewsDir() says
  /**
   * Stored view whose direction is estimated while there is no goal, and to which the base drives when a goal's `view`
   * is empty. Empty: nothing is estimated, and such a goal is refused.
   */
  std::string view;
  std::string base_frame = "base_link";  ///< tf frame of the base, in which commands are expressed
  double image_timeout = 0.25;           ///< the base is stopped when no image has come for this time [s]
  double odometry_timeout = 0.25;        ///< the base is stopped when no odometry has come for this time [s]
  double odometry_delay = 0.0;           ///< odometry's stamps are later than images' of the same moment by this [s]
  /**
   * While the view's points are not tracked, the base is stopped without matches for this time, or for three of their
   * periods where these are longer [s].
   */
  double match_timeout = 0.25;
  HomingParams homing;
  VelocityLimits limits;  ///< of the commands

  HomingDriverParams()
  {
    node.timeout = 120.0;
  }

  /** Time after which a goal without an input ends [s]. */
  double patience() const
  {
    return homing.lost_timeout;
  }
  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(HomingDriverParams& params);

/** Parameters of the node route_follower: those of homing, but for the ones of a single view and of mode `thesis`. */
struct RouteFollowerParams : HomingDriverParams
{
  RouteGuideParams guide;

  RouteFollowerParams()
  {
    node.timeout = 600.0;
  }

  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(RouteFollowerParams& params);

/** The same without those of the guide. */
std::vector<Parameter> homingParameters(RouteFollowerParams& params);

/** Parameters of the node servo_25d. */
struct ServoDriverParams
{
  DriverParams node;
  std::filesystem::path views_dir;   ///< directory of the stored views; empty: as viewsDir() says
  double acquire_timeout = 15.0;     ///< a goal ends when the view has not been found after this time [s]
  double homography_timeout = 0.25;  ///< the arm is stopped when no homography has come for this time [s]
  double max_homography_age = 0.5;   ///< homographies of older images are not used [s]
  double joint_margin = 0.02;        ///< a goal ends when a joint comes this near to its limit [rad or m]
  double joint_timeout = 1.0;        ///< the arm is stopped when joint states have ceased for this time [s]
  Servo25dParams servo;
  VelocityLimits limits = ARM_LIMITS;

  double patience() const
  {
    return servo.lost_timeout;
  }
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(ServoDriverParams& params);

}  // namespace view_servo
