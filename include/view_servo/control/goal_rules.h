// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace view_servo
{
/** @file
 * When a driver's goal ends, when its robot stands and when it may move: the one place that decides, without ROS.
 */

/** How far a goal has come, as its driver sees it. */
struct Progress
{
  enum State
  {
    PREPARING,  ///< accepted; the driver waits for what the goal needs
    ACQUIRING,  ///< the driver looks for the view
    DRIVING,    ///< it knows where to go
    LOST,       ///< it knew where to go, and waits until it knows again
    ARRIVED,    ///< at the view
    FAILED      ///< the driver has given up
  };
  State state = PREPARING;
  std::string reason;  ///< why it is in this state, one line
};

/** What else is decisive in a cycle of control. Times are by a steady clock. */
struct Circumstances
{
  bool shutting_down = false;  ///< the node ends
  bool replaced = false;       ///< another goal has come
  bool enabled = true;         ///< the gate lets commands through, or it is a dry run
  bool cancelled = false;      ///< somebody has cancelled the goal
  bool has_listener = true;    ///< somebody listens to the commands, or nobody needs to
  double elapsed = 0.0;        ///< since the goal was accepted [s]
  double timeout = 0.0;        ///< the goal ends once `elapsed` exceeds it [s]; 0 is not "no limit"
  std::string fault;  ///< why the driver's state cannot be trusted any more: time went back, an exception; empty: none
  std::string missing_input;  ///< which input does not come, and since when; empty: all come
  double missing_for = 0.0;   ///< since a cycle first found an input missing [s]; 0 while all come
  std::string held;           ///< why the robot has to stand although all inputs come; empty: it need not
  double patience = 0.0;      ///< a goal ends when an input is missing for longer than this [s]
};

/** What is to be done in a cycle of control. */
struct Verdict
{
  enum What
  {
    DRIVE,    ///< send the velocity that is wanted
    STAND,    ///< send zero, the goal goes on
    SUCCEED,  ///< stop, and end the goal with success
    ABORT     ///< stop, and end the goal without success
  };
  What what;
  std::string reason;  ///< one line, never empty
};

/**
 * Judges a goal. The first of these conditions that holds decides: the node ends, another goal has come, the driver's
 * state cannot be trusted, it is disabled, the goal is cancelled, the robot has arrived, the driver has given up, the
 * time is over, nobody listens, an input is missing, the robot is held. The last three count only
 * once the goal has begun, not while it is prepared. A missing input makes the robot stand, and ends the goal after
 * `patience`. Where none of them holds, it drives if the driver is in state DRIVING, and else stands. A driver that
 * gives up may do so for want of an input: the reason says both then.
 */
Verdict judge(const Circumstances& circumstances, const Progress& progress);

}  // namespace view_servo
