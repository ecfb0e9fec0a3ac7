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
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of following a route. */
struct RouteGuideParams
{
  /** The base goes on to the next view when it is this near to the present one [m]. */
  double handover_distance = 0.3;
  double handover_turn = 0.15;  ///< largest yaw error at which it then goes on [rad]
  /** It also goes on when the median displacement of the present view's points is at most this [px]. */
  double handover_displacement = 5.0;
  double blind_distance = 0.5;  ///< longest way that the base drives by odometry until the next view is found [m]
  double blind_turn = 0.35;     ///< largest angle that the base turns by odometry until the next view is found [rad]
};

/** Names, units and ranges of these parameters. */
std::vector<Parameter> parameters(RouteGuideParams& params);

/**
 * The stops to drive to, in order.
 * @param start, goal names of views of the route; empty: the first and the last on the way. @param reverse from the
 * last stop of the route to the first. @throws std::invalid_argument naming a view that is not on the route, or saying
 * that the goal comes before the start.
 */
std::vector<RouteStop> stopsBetween(const Route& route, const std::string& start, const std::string& goal,
                                    bool reverse);

/**
 * Whether a stop is where the way has been before or comes to later, after it has been elsewhere, as at the ends of a
 * loop: a picture does not tell which of them is meant.
 */
bool comesByAgain(const std::vector<RouteStop>& stops, std::size_t at, std::size_t other);

/** Where a base is at the stops of a route, as far as that is known. */
struct RoutePlaces
{
  std::vector<PlanarPose> stops;  ///< the base's poses at stops that follow each other, in odometry's frame
  std::size_t index = 0;          ///< in `stops`, of the one that the base drives to
};

/**
 * Leads a base that homes to one view of a route after another: says when it is time for the next one, and where that
 * is by odometry until it is found. Knows no ROS and no time. Poses are of the base in odometry's frame.
 */
class RouteGuide
{
public:
  /**
   * @param stops at least one, in the order in which they are driven to. @param blind_speed on the way by odometry
   * [m/s].
   */
  RouteGuide(const RouteGuideParams& params, std::vector<RouteStop> stops, double blind_speed);

  /** The view that is homed to. */
  const std::string& view() const
  {
    return stops_[index_].view;
  }
  /** Number of view() in the order in which the stops are driven to, from 1. */
  std::size_t number() const
  {
    return index_ + 1;
  }
  /** Number of stops. */
  std::size_t count() const
  {
    return stops_.size();
  }
  /** Whether view() is the last one. */
  bool last() const
  {
    return index_ + 1 == stops_.size();
  }
  /** The view after view(); empty when that is the last. */
  std::string next() const
  {
    return last() ? "" : stops_[index_ + 1].view;
  }

  /** To be called after each image, with what homing to view() knows and the base's pose. */
  void addReport(const HomingReport& report, const PlanarPose& base);
  /** To be called with each reading of odometry. */
  void addOdometry(const PlanarPose& base);

  /** Whether the base is near enough to view() to go on to the next one; never at the last. */
  bool isTimeToGoOn() const
  {
    return due_;
  }
  /** From now on the next view is homed to. There has to be one. */
  void goOn();
  /**
   * Whether the base may go on at `view` instead of view(), which is not found: at another one, but not where the way
   * comes by again (see comesByAgain()), and at an earlier one only once for each view() until that is found, as it may
   * be there no more.
   */
  bool mayJumpTo(const std::string& view) const;
  /** From now on `view` is homed to, which has to be one of the stops; nothing is known yet of where it is. */
  void jumpTo(const std::string& view);

  /**
   * The way to view() by odometry, while homing does not know it: from the last view and how the two were recorded.
   * Empty where homing knows better, nothing is known, or the base has gone as far by odometry as it may.
   */
  std::optional<Course> blindCourse() const;

  /** How the base is placed on the line from the last stop to this one; NaN where that is not known. */
  struct Deviation
  {
    double sideways = std::numeric_limits<double>::quiet_NaN();  ///< from the line, positive to its left [m]
    double yaw = std::numeric_limits<double>::quiet_NaN();       ///< yaw of the base less the recorded one [rad]
  };
  Deviation deviation(const PlanarPose& base) const;

  /**
   * Where view() and the stops about it are: view() as it was found, the others beside it as they were recorded.
   * @param most of stops before view(), and after it. @return no stops while it is not known where view() is.
   */
  RoutePlaces places(std::size_t most) const;

private:
  /** @throws std::logic_error when the view is not one of the stops. */
  std::size_t indexOf(const std::string& view) const;

  RouteGuideParams params_;
  std::vector<RouteStop> stops_;
  double blind_speed_;
  std::size_t index_ = 0;
  std::set<std::size_t> left_;  // stops that were not found, for others that somebody saw
  bool due_ = false;
  bool found_ = false;              // homing knows the way to view()
  std::optional<PlanarPose> goal_;  // the base's pose at view()
  std::optional<PlanarPose> base_;  // the newest pose of the base
  double blind_distance_ = 0.0;     // driven since homing knew the way last [m]
  double blind_turn_ = 0.0;         // turned since homing knew the way last [rad]
};

}  // namespace view_servo
