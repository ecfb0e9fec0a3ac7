// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/node_base.h"

#include <algorithm>

namespace view_servo
{
NodeBase::NodeBase(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
  : nh_(nh), private_nh_(private_nh), diagnostics_(nh, private_nh)
{
  diagnostics_.setHardwareID("none");
  diagnostics_timer_ =
      nh_.createWallTimer(ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { diagnostics_.force_update(); });
}

std::string oneLine(const std::exception& error)
{
  std::string text = error.what();
  while (!text.empty() && text.back() == '\n')
  {
    text.pop_back();
  }
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace view_servo
