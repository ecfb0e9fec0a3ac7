// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/course.h"
#include "view_servo/control/homing.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/route.h"

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of following a route. */
struct RouteGuideParams
{
  double handover_distance = 0.3;  ///< as near to a view, the next one is driven to [m]
  double handover_turn = 0.15;     ///< largest yaw error at that [rad]
  /** The next view is driven to also where the median displacement of this one's points is as small [px]. */
  double handover_displacement = 5.0;
  double blind_distance = 0.5;  ///< longest way by odometry until the next view is found [m]
  double blind_turn = 0.35;     ///< largest turn by odometry until then [rad]
};

/** Names, units and ranges of these parameters. */
std::vector<Parameter> parameters(RouteGuideParams& params);

/**
 * The stops to drive to, in order.
 * @param start, goal names of views of the route; empty: the first and the last on the way. @param reverse from the last
 * stop of the route to the first. @throws std::invalid_argument naming a view that is not on the route, or saying that the
 * goal comes before the start.
 */
std::vector<RouteStop> stopsBetween(const Route& route, const std::string& start, const std::string& goal,
                                    bool reverse);

/**
 * Leads a base that homes to one view of a route after another: says when it is time for the next one, and where that is by
 * odometry until it is found. Knows no ROS and no time. Poses are of the base in odometry's frame.
 */
class RouteGuide
{
public:
  /** @param stops at least one, in the order in which they are driven to. @param blind_speed on the way by odometry [m/s]. */
  RouteGuide(const RouteGuideParams& params, std::vector<RouteStop> stops, double blind_speed);

  /** The view that is homed to. */
  const std::string& view() const
  {
    return stops_[index_].view;
  }
  /** Its number, from 1, of all on the way. */
  std::size_t number() const
  {
    return index_ + 1;
  }
  std::size_t count() const
  {
    return stops_.size();
  }
  bool last() const
  {
    return index_ + 1 == stops_.size();
  }
  /** The view after view(); empty when that is the last. */
  std::string next() const
  {
    return last() ? "" : stops_[index_ + 1].view;
  }

  /** To be called after each image with what homing to view() knows. */
  void see(const HomingReport& report, const PlanarPose& base);
  /** To be called with each reading of odometry. */
  void move(const PlanarPose& base);

  /** Whether the base is near enough to view() to go on to the next one; never at the last. */
  bool due() const
  {
    return due_;
  }
  /** From now on the next view is homed to. There has to be one. */
  void goOn();
  /** From now on this view is homed to, and nothing is known of where it is. It has to be on the way. */
  void goTo(const std::string& view);

  /**
   * The way to view() by odometry, while homing does not know it: from the last view and how the two were recorded. Empty
   * where homing knows better, nothing is known, or the base has gone as far by odometry as it may.
   */
  std::optional<Course> blindCourse() const;

  /** How the base is placed on the line from the last stop to this one; NaN where that is not known. */
  struct Deviation
  {
    double sideways = std::numeric_limits<double>::quiet_NaN();  ///< from the line, positive to its left [m]
    double yaw = std::numeric_limits<double>::quiet_NaN();       ///< against the recorded one [rad]
  };
  Deviation deviation(const PlanarPose& base) const;

private:
  RouteGuideParams params_;
  std::vector<RouteStop> stops_;
  double blind_speed_;
  std::size_t index_ = 0;
  bool due_ = false;
  bool found_ = false;              // homing knows the way to view()
  std::optional<PlanarPose> goal_;  // at view()
  std::optional<PlanarPose> base_;  // the newest
  double blind_distance_ = 0.0;     // since the way was known last [m]
  double blind_turn_ = 0.0;         // [rad]
};

}  // namespace view_servo
