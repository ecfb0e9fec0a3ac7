// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/route_guide.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/** The pose of one stop's base in another's, as recorded. */
PlanarPose relative(const RouteStop& from, const RouteStop& to)
{
  return compose(inverse(from.base), to.base);
}

}  // namespace

std::vector<Parameter> parameters(RouteGuideParams& params)
{
  return {
    real("handover_distance", params.handover_distance, "m", "> 0",
         "distance from a view that is not the goal's at which the base goes on to the next one"),
    real("handover_turn", params.handover_turn, "rad", "> 0", "largest yaw error at which it then goes on"),
    real("handover_displacement", params.handover_displacement, "px", "> 0",
         "median distance of the view's points from their places at which it goes on, too, as the distance may not be "
         "known in metres"),
    real("blind_distance", params.blind_distance, "m", ">= 0",
         "how far a holonomic base goes on by odometry until the next view is found; then it stands and waits"),
    real("blind_turn", params.blind_turn, "rad", ">= 0", "how far it turns by odometry until the next view is found"),
  };
}

std::vector<RouteStop> stopsBetween(const Route& route, const std::string& start, const std::string& goal, bool reverse)
{
  std::vector<RouteStop> stops = route.stops;
  if (reverse)
  {
    std::reverse(stops.begin(), stops.end());
  }
  const auto find = [&](const std::string& view) {
    const auto found =
        std::find_if(stops.begin(), stops.end(), [&](const RouteStop& stop) { return stop.view == view; });
    if (found == stops.end())
    {
      throw std::invalid_argument("view '" + view + "' is not on route '" + route.name + "'");
    }
    return found;
  };
  const auto first = start.empty() ? stops.begin() : find(start);
  const auto last = goal.empty() ? stops.end() - 1 : find(goal);
  if (last < first)
  {
    throw std::invalid_argument("view '" + last->view + "' comes before view '" + first->view + "' on route '" +
                                route.name + (reverse ? "' in reverse" : "'; reverse: true drives backwards"));
  }
  return { first, last + 1 };
}

bool comesByAgain(const std::vector<RouteStop>& stops, std::size_t at, std::size_t other)
{
  constexpr double NEAR = 0.5;   // [m]
  constexpr double ALIKE = 0.5;  // [rad]
  const auto is_there = [&](const RouteStop& stop) {
    const PlanarPose way = relative(stops[at], stop);
    return way.distance() < NEAR && std::abs(way.yaw) < ALIKE;
  };
  const auto between = stops.begin() + static_cast<std::ptrdiff_t>(std::min(at, other));
  const auto end = stops.begin() + static_cast<std::ptrdiff_t>(std::max(at, other));
  return is_there(stops[other]) && !std::all_of(between, end, is_there);
}

RouteGuide::RouteGuide(const RouteGuideParams& params, std::vector<RouteStop> stops, double blind_speed)
  : params_(params), stops_(std::move(stops)), blind_speed_(blind_speed)
{
  if (stops_.empty())
  {
    throw std::logic_error("a way without views");
  }
}

void RouteGuide::addReport(const HomingReport& report, const PlanarPose& base)
{
  found_ = report.state == HomingState::APPROACHING || report.state == HomingState::NEAR ||
           report.state == HomingState::DOCKING || report.state == HomingState::ARRIVED;
  due_ = false;
  if (report.contradicted)
  {
    goal_.reset();  // it came from a picture that is not the view's, and nobody goes on towards it
  }
  if (!found_)
  {
    return;
  }
  left_.erase(index_);
  blind_distance_ = blind_turn_ = 0.0;
  if (!report.tracked || !report.trusted)
  {
    return;
  }
  const bool in_place = report.displacement <= params_.handover_displacement || report.state == HomingState::ARRIVED;
  if (report.goal_in_odom)
  {
    goal_ = report.goal_in_odom;
  }
  else if (in_place)
  {
    // The view's points are nearly in place, so the base is near, whatever the scale of the distance is.
    const double distance = std::min(report.distance, params_.handover_distance);
    goal_ =
        compose(base, { distance * std::cos(report.heading), distance * std::sin(report.heading), report.yaw_error });
  }
  const bool near = report.goal_in_odom && report.distance <= params_.handover_distance &&
                    std::abs(report.yaw_error) <= params_.handover_turn;
  due_ = !last() && (near || in_place);
}

void RouteGuide::addOdometry(const PlanarPose& base)
{
  if (base_ && !found_)
  {
    const PlanarPose moved = compose(inverse(*base_), base);
    blind_distance_ += moved.distance();
    blind_turn_ += std::abs(moved.yaw);
  }
  base_ = base;
}

void RouteGuide::goOn()
{
  if (last())
  {
    throw std::logic_error("there is no next view");
  }
  if (goal_)
  {
    goal_ = compose(*goal_, relative(stops_[index_], stops_[index_ + 1]));
  }
  ++index_;
  due_ = found_ = false;
  blind_distance_ = blind_turn_ = 0.0;
}

std::size_t RouteGuide::indexOf(const std::string& view) const
{
  const auto found =
      std::find_if(stops_.begin(), stops_.end(), [&](const RouteStop& stop) { return stop.view == view; });
  if (found == stops_.end())
  {
    throw std::logic_error("the view is not on the way");
  }
  return static_cast<std::size_t>(found - stops_.begin());
}

bool RouteGuide::mayJumpTo(const std::string& view) const
{
  const std::size_t index = indexOf(view);
  return (index > index_ || (index < index_ && left_.count(index_) == 0)) && !comesByAgain(stops_, index_, index);
}

void RouteGuide::jumpTo(const std::string& view)
{
  const std::size_t index = indexOf(view);
  left_.insert(index_);
  index_ = index;
  goal_.reset();
  due_ = found_ = false;
  blind_distance_ = blind_turn_ = 0.0;
}

std::optional<Course> RouteGuide::blindCourse() const
{
  if (found_ || !goal_ || blind_distance_ >= params_.blind_distance || blind_turn_ >= params_.blind_turn)
  {
    return std::nullopt;
  }
  Course course;
  course.kind = Course::TO_VIEW;
  course.view = *goal_;
  course.max_speed = blind_speed_;
  return course;
}

RouteGuide::Deviation RouteGuide::deviation(const PlanarPose& base) const
{
  if (!goal_ || index_ == 0)
  {
    return {};
  }
  const PlanarPose before = compose(*goal_, relative(stops_[index_], stops_[index_ - 1]));
  const double x = goal_->x - before.x;
  const double y = goal_->y - before.y;
  const double length = std::hypot(x, y);
  const double turn = wrapAngle(goal_->yaw - before.yaw);
  Deviation deviation;
  double part = 1.0;  // of the way from one stop to the other
  if (length > 0.0)
  {
    deviation.sideways = (x * (base.y - before.y) - y * (base.x - before.x)) / length;
    part = std::clamp((x * (base.x - before.x) + y * (base.y - before.y)) / (length * length), 0.0, 1.0);
  }
  deviation.yaw = wrapAngle(base.yaw - before.yaw - part * turn);
  return deviation;
}

RoutePlaces RouteGuide::places(std::size_t most) const
{
  RoutePlaces places;
  if (!goal_)
  {
    return places;
  }
  const std::size_t first = index_ - std::min(index_, most);
  const std::size_t end = index_ + std::min(stops_.size() - index_, most + 1);
  places.index = index_ - first;
  for (std::size_t i = first; i < end; ++i)
  {
    places.stops.push_back(compose(*goal_, relative(stops_[index_], stops_[i])));
  }
  return places;
}

}  // namespace view_servo
