// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"

#include <cstddef>
#include <string>
#include <vector>

namespace view_servo
{
/** A stored view on a route, and where the base was when it was taken. */
struct RouteStop
{
  std::string view;    ///< name of the stored view
  PlanarPose base;     ///< pose of the base in Route::frame [m, rad]
  double stamp = 0.0;  ///< when the image was taken, as its header says [s]
};

/** Stored views in the order in which a base passed them. */
struct Route
{
  std::string name;              ///< see isValidRouteName()
  std::string frame;             ///< odometry's, in which the poses are; it may drift along the route
  std::vector<RouteStop> stops;  ///< 2 to MAX_ROUTE_STOPS, of different views
};

/** Largest number of stops of a route. */
constexpr std::size_t MAX_ROUTE_STOPS = 10000;

/**
 * Whether a name is one of a view (see isValidViewName()) and leaves room for the numbers of its views: 58 characters
 * at most.
 */
bool isValidRouteName(const std::string& name);

/** The name that a recorder stores a route's view by: `ROUTE_001` for the number 1. */
std::string viewNameOf(const std::string& route, std::size_t number);

/** The sum of the distances between neighbouring stops [m]. */
double lengthOf(const Route& route);

}  // namespace view_servo
