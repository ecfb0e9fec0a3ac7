// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
//
// The nodelet of a library of its own, which is under the GPL because it links ViSP.
#include "nodes/nodelet_of.h"
#include "nodes/nodes.h"

#include <pluginlib/class_list_macros.hpp>

namespace view_servo
{
using Servo25dNodelet = NodeletOf<SERVO_25D>;
}  // namespace view_servo

PLUGINLIB_EXPORT_CLASS(view_servo::Servo25dNodelet, nodelet::Nodelet)
