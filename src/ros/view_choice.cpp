// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/view_choice.h"

#include <utility>

namespace view_servo
{
void ViewChoice::choose(const std::string& view)
{
  chosen_ = { view, "" };
  by_driver_ = false;
}

bool ViewChoice::want(const WantedView& message)
{
  const std::optional<WantedView> before = std::exchange(last_message_, message);
  const bool repeated = before && before->header.stamp == message.header.stamp && before->view == message.view &&
                        before->goal == message.goal;
  if (repeated || (message.view.empty() && !by_driver_))
  {
    return false;
  }
  chosen_ = { message.view, message.view.empty() ? "" : message.goal };
  by_driver_ = !message.view.empty();
  return true;
}

}  // namespace view_servo
