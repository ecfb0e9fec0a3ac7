// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/session_starter.h"
#include "view_servo/tracking/route_spacing.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/view_recognizer.h"

#include <filesystem>
#include <string>
#include <vector>

namespace view_servo
{
/** Parameters of the node view_store. */
struct ViewStoreNodeParams
{
  CameraInputParams camera;
  ImageSourceParams sources;
  std::string fixed_frame = "odom";  ///< frame in which the camera's pose is stored with a view; empty: never
  double idle_timeout = 60.0;        ///< see CameraInput::connectWhenAsked() [s]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units, ranges and meanings of these parameters, here and below. */
std::vector<Parameter> parameters(ViewStoreNodeParams& params);

/** Parameters of the node homography_tracker, but for those in its sub-namespace. */
struct HomographyTrackerNodeParams
{
  CameraInputParams camera;
  SessionStarterParams sessions;
  std::string view;                 ///< stored view that is followed from the start; empty: none
  double match_period = 0.3;        ///< time from one search for the view to the next [s]
  PointViewMatcherParams matching;  ///< in the sub-namespace `matching`; read and checked by themselves

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(HomographyTrackerNodeParams& params);

/** Parameters of the node view_recognizer. */
struct ViewRecognizerNodeParams
{
  CameraInputParams camera;
  ImageSourceParams sources;
  double rate = 1.0;  ///< camera images are recognized at most this often [Hz]
  ViewRecognizerParams recognition;

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(ViewRecognizerNodeParams& params);

/** The same without those of the recognition. */
std::vector<Parameter> nodeParameters(ViewRecognizerNodeParams& params);

/** Parameters of the node route_recorder. */
struct RouteRecorderParams
{
  CameraInputParams camera;
  std::filesystem::path views_dir;       ///< directory of the stored views; empty: as viewsDir() says
  std::string base_frame = "base_link";  ///< tf frame of the base, whose pose odometry is
  double odometry_delay = 0.0;           ///< odometry's stamps are later than images' of the same moment by this [s]
  double patience = 5.0;                 ///< longest wait of ~start and ~stop for an image and odometry [s]
  std::string overwrite;                 ///< name of the route that ~start replaces; empty: none
  RouteSpacingParams spacing;

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

std::vector<Parameter> parameters(RouteRecorderParams& params);

}  // namespace view_servo
