// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

namespace view_servo
{
/** What a joint can do [rad] or [m]. */
struct JointLimits
{
  double lower;
  double upper;
};

/**
 * Watches over an arm's joints: which of them is at a limit and does not come away from it. Times in seconds of any one clock. What was
 * said of a joint does not count for ever.
 */
class JointGuard
{
public:
  /**
   * @param margin that counts as being at a limit, as the limits' unit, >= 0.
   * @param max_age after which what was said of a joint does not count any more [s], > 0.
   */
  JointGuard(std::map<std::string, JointLimits> limits, double margin, double max_age);

  /**
   * Where joints are. Those without limits do not matter, others may be missing.
   * @param velocities as many as positions, or none: then they follow from the positions.
   * @return which position is not believed, as it is no number or lies far beyond the limits; empty: all are.
   */
  std::string add(double time, const std::vector<std::string>& names, const std::vector<double>& positions,
                  const std::vector<double>& velocities);

  /**
   * Called while the arm is to move: the joint that goes further towards a limit that it is at, or stands there for longer
   * than an arm takes to follow, and where it is; empty: none.
   */
  std::string problem(double time);

  /** Called when the arm is not to move. */
  void rest();

  bool empty() const
  {
    return limits_.empty();
  }

private:
  struct Joint
  {
    double time;
    double position;
    double velocity;
  };

  std::map<std::string, JointLimits> limits_;
  double margin_;
  double max_age_;
  std::map<std::string, Joint> joints_;
  std::map<std::string, double> stuck_since_;
};

}  // namespace view_servo
