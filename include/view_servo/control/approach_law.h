// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/course.h"
#include "view_servo/control/manoeuvre_planner.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"

#include <memory>
#include <string>
#include <vector>

namespace view_servo
{
/** How a base can move. */
enum class BaseKind
{
  HOLONOMIC,    ///< in any direction, turning or not
  DIFFERENTIAL  ///< ahead and back, turning or not; on the spot, too
};

/** Options of an approach. */
struct ApproachParams
{
  BaseKind base = BaseKind::HOLONOMIC;
  double gain = 1.0;                  ///< speed per distance [1/s]
  double turn_gain = 1.0;             ///< turn rate per yaw error [1/s]
  double min_speed = 0.015;           ///< DIFFERENTIAL: the base drives no slower [m/s]
  double min_turn_rate = 0.06;        ///< DIFFERENTIAL: the base turns on the spot no slower [rad/s]
  double distance_tolerance = 0.002;  ///< distance from the view at which the base has arrived [m]
  double yaw_tolerance = 0.002;       ///< yaw error at which it has arrived [rad]
  ManoeuvreParams manoeuvre;          ///< of a DIFFERENTIAL base
};

/** Names, units and ranges of these parameters. */
std::vector<Parameter> parameters(ApproachParams& params);

/** What is known after an image or odometry. Poses are in odometry's frame. */
struct Situation
{
  PlanarPose base_in_odom;  ///< the newest pose of the base
  PlanarPose goal_in_odom;  ///< the base's pose at the view
  bool known_anew = false;  ///< this update is for an image or matches that showed the view
  bool seen = false;        ///< this update is for an image in which the view's points were found
  ShareInSight share;       ///< which share of the view the camera has in sight from a pose
};

/** Decides what a base does to reach the goal. Knows no ROS and no time. */
class ApproachLaw
{
public:
  virtual ~ApproachLaw() = default;

  /** To be called after each image and each reading of odometry. */
  virtual void update(const Situation& situation) = 0;

  /** What the base should do now; STAND where no way is known. */
  virtual Course course() const = 0;

  /** Distance from the goal at which the base has arrived [m]. */
  virtual double tolerance() const = 0;

  /** What the base does, or why it stands, for people; empty: nothing worth a word. */
  virtual std::string text() const = 0;

  /** Why the goal cannot be reached; empty while it can. */
  virtual std::string failure() const = 0;
};

/**
 * The law for params.base. The parameters must be valid.
 * @param most_tolerance the largest tolerance() of a DIFFERENTIAL base [m]: each time that corrections have not brought
 * it within tolerance(), the tolerance grows, until this. A HOLONOMIC base's tolerance() does not change.
 */
std::unique_ptr<ApproachLaw> makeApproachLaw(const ApproachParams& params, double most_tolerance);

}  // namespace view_servo
