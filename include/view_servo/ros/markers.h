// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/homing.h"
#include "view_servo/control/route_guide.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/tracking/plane_tracker.h"

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/types.hpp>

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * What a driver or tracker knows, as markers for rviz.
 *
 * Each message says everything: it has a marker for each part of the drawing, with a namespace of its own and the id 0,
 * which is added, or deleted while the part is not known. So whoever reads the newest message alone sees what is known
 * now. Numbers are finite. Parts that hold for a moment only (the camera, a direction, the way to go) have a lifetime.
 *
 * | namespace | what | frame |
 * |---|---|---|
 * | view | the frustum of the view's camera at its pose; the triangle is above its upper edge | odometry's |
 * | camera | the frustum of the camera now | the camera's optical frame |
 * | direction | an arrow to the view, while only its direction is known | the base's; of an arm, the camera's |
 * | way_to_go, way_driven | lines on the floor; of an arm, through the air | odometry's |
 * | points | the view's points: green where they support its pose, red where they do not | odometry's |
 * | plane | the view's region on its plane | odometry's |
 * | route, stops | a line on the floor, and where its views were stored: blue those to come | odometry's |
 */

/** What homing to a view knows. */
struct HomingScene
{
  ros::Time stamp;                                                     ///< of the newest image
  std::string odom_frame;                                              ///< odometry's frame, in which poses are
  std::string base_frame;                                              ///< the base's frame
  PlanarPose base;                                                     ///< the base's newest pose
  HomingReport report;                                                 ///< of the newest image
  Course course;                                                       ///< of the base
  Camera camera;                                                       ///< that is there now
  std::string camera_frame;                                            ///< its optical frame
  Camera view_camera;                                                  ///< that the view was taken with
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();  ///< the optical frame's pose in base_link
  std::vector<HomingLandmark> landmarks;                               ///< see Homing::landmarks()
  std::vector<Eigen::Vector3d> driven;                                 ///< places of the base, oldest first
  std::optional<RoutePlaces> route;                                    ///< of a base that follows one
};

/** Without "plane", and without "route" and "stops" where no route is followed. */
visualization_msgs::MarkerArray toMarkers(const HomingScene& scene);

/** What following a plane knows. */
struct PlaneScene
{
  std_msgs::Header header;                          ///< of the newest image
  std::string odom_frame;                           ///< the frame that does not jump; empty: none
  std::optional<Eigen::Isometry3d> camera_in_odom;  ///< pose of the camera, where odometry knows it
  Camera camera;                                    ///< a pinhole: of rectified images, and of the view in them
  cv::Rect region;                                  ///< of the view that shows the plane [px]
  PlaneTrack track;                                 ///< of the newest image
  Points points;                                    ///< of the view that are looked for [px]
  std::vector<Eigen::Vector3d> driven;              ///< places of the camera in odom_frame, oldest first
};

/** Without what needs metres, while the plane's distance or the camera's pose is not known. */
visualization_msgs::MarkerArray toMarkers(const PlaneScene& scene);

/** Deletes what another message has added. Of its markers those that it deletes itself are left out. */
visualization_msgs::MarkerArray deletionOf(const visualization_msgs::MarkerArray& message);

}  // namespace view_servo
