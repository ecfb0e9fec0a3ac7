// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
//
// The nodelets that do without ViSP, as nodelets/view_servo_nodelets.xml names them.
#include "nodes/nodelet_of.h"
#include "nodes/nodes.h"

#include <pluginlib/class_list_macros.hpp>

namespace view_servo
{
using HomingNodelet = NodeletOf<HOMING>;
using HomographyTrackerNodelet = NodeletOf<HOMOGRAPHY_TRACKER>;
using LineMatcherNodelet = NodeletOf<LINE_MATCHER>;
using PointMatcherNodelet = NodeletOf<POINT_MATCHER>;
using RouteFollowerNodelet = NodeletOf<ROUTE_FOLLOWER>;
using RouteRecorderNodelet = NodeletOf<ROUTE_RECORDER>;
using SceneMatcherNodelet = NodeletOf<SCENE_MATCHER>;
using ViewRecognizerNodelet = NodeletOf<VIEW_RECOGNIZER>;
using ViewStoreNodelet = NodeletOf<VIEW_STORE>;
}  // namespace view_servo

PLUGINLIB_EXPORT_CLASS(view_servo::HomingNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::HomographyTrackerNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::LineMatcherNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::PointMatcherNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::RouteFollowerNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::RouteRecorderNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::SceneMatcherNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::ViewRecognizerNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(view_servo::ViewStoreNodelet, nodelet::Nodelet)
