// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/goal_rules.h"

#include <cstdio>

namespace view_servo
{
namespace
{
std::string reasonOf(const Progress& progress)
{
  return progress.reason.empty() ? "nothing is known yet" : progress.reason;
}

std::string inSeconds(double time)
{
  char text[40];
  std::snprintf(text, sizeof(text), "%.3g s", time);
  return text;
}

}  // namespace

Verdict judge(const Circumstances& circumstances, const Progress& progress)
{
  const bool prepared = progress.state != Progress::PREPARING;
  if (circumstances.shutting_down)
  {
    return { Verdict::ABORT, "the node is shutting down" };
  }
  if (circumstances.replaced)
  {
    return { Verdict::ABORT, "another goal has come" };
  }
  if (!circumstances.fault.empty())
  {
    return { Verdict::ABORT, circumstances.fault };
  }
  if (!circumstances.enabled)
  {
    return { Verdict::ABORT, "disabled" };
  }
  if (circumstances.cancelled)
  {
    return { Verdict::ABORT, "the goal was cancelled" };
  }
  if (progress.state == Progress::ARRIVED)
  {
    return { Verdict::SUCCEED, reasonOf(progress) };
  }
  if (progress.state == Progress::FAILED)
  {
    const std::string& missing = circumstances.missing_input;
    const std::string reason = reasonOf(progress);
    const bool is_said = reason.find(missing) != std::string::npos;  // also when nothing is missing
    return { Verdict::ABORT, is_said ? reason : reason + ": " + missing };
  }
  if (!(circumstances.elapsed <= circumstances.timeout))
  {
    return { Verdict::ABORT, (prepared ? "not at the view within " : "not begun within ") +
                                 inSeconds(circumstances.timeout) + ": " +
                                 (circumstances.missing_input.empty() || !prepared ? reasonOf(progress)
                                                                                   : circumstances.missing_input) };
  }
  if (prepared && !circumstances.has_listener)
  {
    return { Verdict::ABORT, "nobody listens any more to the commands" };
  }
  if (prepared && !circumstances.missing_input.empty())
  {
    const bool given_up = circumstances.missing_for > circumstances.patience;
    return { given_up ? Verdict::ABORT : Verdict::STAND, circumstances.missing_input };
  }
  if (prepared && !circumstances.held.empty())
  {
    return { Verdict::STAND, circumstances.held };
  }
  return { progress.state == Progress::DRIVING ? Verdict::DRIVE : Verdict::STAND, reasonOf(progress) };
}

}  // namespace view_servo
