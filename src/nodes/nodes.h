// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/node_type.h"

namespace view_servo
{
/** The nodes that are processes of their own and nodelets. Each is defined in the source of its name. */
extern const NodeType HOMING;
extern const NodeType HOMOGRAPHY_TRACKER;
extern const NodeType LINE_MATCHER;
extern const NodeType POINT_MATCHER;
extern const NodeType ROUTE_FOLLOWER;
extern const NodeType ROUTE_RECORDER;
extern const NodeType SCENE_MATCHER;
extern const NodeType SERVO_25D;
extern const NodeType VIEW_RECOGNIZER;
extern const NodeType VIEW_STORE;

}  // namespace view_servo
