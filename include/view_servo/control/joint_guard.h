// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
/** The range of a joint's positions: [rad] of one that turns, [m] of one that slides. */
struct JointLimits
{
  double lower;
  double upper;
};

/**
 * Watches the joints of an arm and names one that is at a limit and does not come away from it. Times are seconds of
 * any one clock.
 */
class JointGuard
{
public:
  /**
   * @param margin a joint is at a limit when it is closer to it than this, in the limits' unit, >= 0.
   * @param max_age a joint that was not heard of for longer is left out [s], > 0.
   */
  JointGuard(std::map<std::string, JointLimits> limits, double margin, double max_age);

  /**
   * A new goal begins: what was heard of joints before is forgotten.
   * @param carrying joints that move the camera, which alone are watched from now on; a gripper's may rest at a limit.
   * Empty: they are not known, and any joint is watched that has moved since, and all while none moves as it should.
   */
  void begin(std::set<std::string> carrying);

  /** Whether a message says where a watched joint is. Arguments as of add(). */
  bool tells(const std::vector<std::string>& names, const std::vector<double>& positions) const;

  /** Name of a watched joint that was heard of since begin(), but not for max_age; empty: there is none. */
  std::string silent(double time) const;

  /**
   * Takes where joints are: a position [rad or m] for each name. Joints without limits are ignored, and some may be
   * missing.
   * @param velocities one for each name [rad/s or m/s]; when there are fewer or more, they are computed from the
   * positions.
   * @return a message naming a position that is ignored because it is not a finite number or lies far beyond the
   * limits; empty when no position is ignored.
   */
  std::string add(double time, const std::vector<std::string>& names, const std::vector<double>& positions,
                  const std::vector<double>& velocities);

  /**
   * Called while the arm is to move.
   * @return a message naming a joint at a limit that moves on towards it, or has been there for longer than an arm
   * takes to follow a command, and its position; empty: there is none.
   */
  std::string problem(double time);

  /** Called when the arm is not to move: the time that joints have been at their limits begins anew. */
  void clearStuck();

  /** Whether there are no limits, so that nothing is watched. */
  bool empty() const
  {
    return limits_.empty();
  }

private:
  struct Joint
  {
    double time;      // [s]
    double position;  // [rad] or [m]
    double velocity;  // [rad/s] or [m/s]
    double first;     // position when it was heard of first
  };

  bool watched(const std::string& name, const Joint& joint) const;

  std::map<std::string, JointLimits> limits_;
  double margin_;
  double max_age_;
  double last_motion_ = 0.0;                       // of any joint, or when the arm was told to move [s]
  bool is_told_ = false;                           // to move, by the last problem() or clearStuck()
  std::optional<std::set<std::string>> carrying_;  // empty before begin(): all are watched
  std::map<std::string, Joint> joints_;
  std::map<std::string, double>
      stuck_since_;  // by joint: the time since which it is at a limit while the arm should move
};

}  // namespace view_servo
