// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/numbers.h"

#include "check/motion.h"

#include <algorithm>
#include <cmath>

namespace view_servo::check
{
namespace
{
constexpr double MOVED_AT_ALL = 0.25;          // part of what was asked
constexpr double SCALE_BY_COMMAND = 0.25;      // part by which a robot may do more or less than it is told
constexpr double SCALE_BY_IMAGES = 0.10;       // part by which odometry's angle may differ from that of the images
constexpr double ANOTHER_WAY = 60.0 * DEGREE;  // directions beyond this have another meaning
constexpr double SLANTED = 15.0 * DEGREE;

/** The part of a motion that a leg is about, as a vector. */
const Eigen::Vector3d& part(const Leg& leg, const Motion& motion)
{
  return leg.turns ? motion.rotation : motion.translation;
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

std::string amount(const Leg& leg, double value)
{
  return leg.turns ? number(value / DEGREE, 1) + " degrees" : number(value, 3) + " m";
}

/** What to mend when one of three disagrees with the two others. */
std::string remedyFor(const std::string& culprit, const Leg& leg)
{
  if (culprit == "images")
  {
    return "correct the camera's frame in tf: it is turned, upside down or not optical, or the picture is mirrored";
  }
  if (culprit == "commands")
  {
    return "commands have to be in the frame and with the signs of REP 103: correct the robot's driver";
  }
  return leg.measured_by == "odometry"
             ? "correct odometry's signs: x ahead, y to the left, turns to the left positive (REP 103)"
             : "correct the arm's URDF, or the camera's place in the hand (hand-eye calibration)";
}

/** Where directions disagree: the one of three that two others contradict. */
Finding judgeDirections(const Leg& leg, const std::string& name, const std::string& found)
{
  const Eigen::Vector3d& asked = part(leg, leg.asked);
  const Eigen::Vector3d& measured = part(leg, leg.measured);
  const Eigen::Vector3d& seen = part(leg, *leg.seen.motion);
  const bool measured_as_asked = angleBetween(asked, measured) < ANOTHER_WAY;
  const bool seen_as_asked = angleBetween(asked, seen) < ANOTHER_WAY;
  const bool seen_as_measured = angleBetween(measured, seen) < ANOTHER_WAY;
  const std::string culprit = measured_as_asked  ? "images"
                              : seen_as_asked    ? leg.measured_by
                              : seen_as_measured ? "commands"
                                                 : "";
  if (culprit.empty())
  {
    return error(name, "command, " + leg.measured_by + " and images each say another direction: " + found,
                 "look at the lines above first, then at the camera's frame in tf");
  }
  const std::string others = culprit == "images"     ? "command and " + leg.measured_by + " contradict the images"
                             : culprit == "commands" ? leg.measured_by + " and images contradict the command"
                                                     : "command and images contradict " + leg.measured_by;
  return error(name, others + ": " + found, remedyFor(culprit, leg));
}

Finding judgeAmounts(const Leg& leg, const std::string& name, const std::string& found)
{
  const double asked = part(leg, leg.asked).norm();
  const double measured = part(leg, leg.measured).norm();
  const Eigen::Vector3d& seen = part(leg, *leg.seen.motion);
  if (!leg.by_hand && std::abs(measured / asked - 1.0) > SCALE_BY_COMMAND)
  {
    return warning(name, found, "look for wrong units or scale in the robot's driver or in " + leg.measured_by);
  }
  if (leg.turns && std::abs(seen.norm() / measured - 1.0) > SCALE_BY_IMAGES)
  {
    return warning(name, found,
                   "calibrate the scale of turns in " + leg.measured_by + ", or the camera's focal length");
  }
  if (angleBetween(part(leg, leg.measured), seen) > SLANTED)
  {
    return warning(name, found, "calibrate where the camera is in tf: its yaw, and whether it is level");
  }
  return ok(name, found);
}

}  // namespace

Finding judgeLeg(const Leg& leg)
{
  const std::string name = "move " + leg.name;
  const Eigen::Vector3d& asked = part(leg, leg.asked);
  const Eigen::Vector3d& measured = part(leg, leg.measured);
  const std::string by = (leg.by_hand ? "by hand, " : amount(leg, asked.norm()) + " commanded, ") +
                         amount(leg, measured.norm()) + " by " + leg.measured_by;
  if (measured.norm() < MOVED_AT_ALL * asked.norm())
  {
    return error(name, by + ": it hardly moved",
                 leg.by_hand ? "push it as far as asked for; else " + leg.measured_by + " does not see that it moves"
                             : "look whether brakes, an emergency stop, or limits of the driver hold it, or whether " +
                                   leg.measured_by + " stands still");
  }
  if (!leg.seen.motion)
  {
    return warning(name, by + "; " + leg.seen.fault, "let the camera see more texture, and nothing that moves");
  }
  const Eigen::Vector3d& seen = part(leg, *leg.seen.motion);
  if (seen.isZero())
  {
    return warning(name, by + "; the images show a turn instead",
                   "let the camera see something nearer, so that a move looks other than a turn");
  }
  const double off = angleBetween(measured, seen);
  const std::string found =
      by + (leg.turns ? ", " + amount(leg, (off < M_PI_2 ? 1.0 : -1.0) * seen.norm()) + " by images"
                      : ", images say " + number(off / DEGREE, 0) + " degrees from there");
  const bool alike = angleBetween(asked, measured) < ANOTHER_WAY && off < ANOTHER_WAY;
  return alike ? judgeAmounts(leg, name, found) : judgeDirections(leg, name, found);
}

}  // namespace view_servo::check
