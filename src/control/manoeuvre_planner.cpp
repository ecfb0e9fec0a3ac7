// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/manoeuvre_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
/** Places, in the goal's frame, that a base drives to in turn. */
using Places = std::vector<Eigen::Vector2d>;

/** The leg from one place to another, ahead or back: as it turns the camera less away from the view. */
Leg legBetween(const Eigen::Vector2d& from, const Eigen::Vector2d& to)
{
  const Eigen::Vector2d way = to - from;
  const bool backwards = way.x() < 0.0;
  const double yaw = backwards ? std::atan2(-way.y(), -way.x()) : std::atan2(way.y(), way.x());
  return { { to.x(), to.y(), yaw }, backwards };
}

double lengthOf(const PlanarPose& from, const Leg& leg)
{
  return std::hypot(leg.end.x - from.x, leg.end.y - from.y);
}

class Planner
{
public:
  Planner(const PlanarPose& base, const ShareInSight& share, const ManoeuvreParams& params)
    : base_(base), share_(share), params_(params)
  {
  }

  Manoeuvre plan()
  {
    std::vector<Manoeuvre> candidates;
    for (const Places& places : ways())
    {
      Manoeuvre candidate;
      Eigen::Vector2d from(base_.x, base_.y);
      for (const Eigen::Vector2d& to : places)
      {
        candidate.legs.push_back(legBetween(from, to));
        from = to;
      }
      candidate.legs.back().end.yaw = 0.0;  // whatever is left across is made up for on the way
      candidate.duration = durationOf(candidate);
      candidate.length = lengthOf(candidate);
      candidates.push_back(std::move(candidate));
    }
    std::sort(candidates.begin(), candidates.end(),
              [this](const Manoeuvre& a, const Manoeuvre& b) { return costOf(a) < costOf(b); });
    Manoeuvre best;
    double least = std::numeric_limits<double>::infinity();
    for (Manoeuvre& candidate : candidates)
    {
      if (costOf(candidate) >= least || looks_ > MOST_LOOKS)
      {
        break;  // of those that follow each costs more, even with all of the view in sight
      }
      if (lookAlong(candidate, least))
      {
        least = costOf(candidate);
        best = std::move(candidate);
      }
    }
    return best;
  }

private:
  static constexpr double GRID = 0.2;                 // between places that are tried [m]
  static constexpr double MOST_PLACES = 25.0;         // in a row; farther away they lie farther apart
  static constexpr int MOST_LOOKS = 5000;             // each takes up to a quarter of a millisecond
  static constexpr double SECONDS_PER_SHARE = 100.0;  // what a lack of the view in sight counts for
  static constexpr double SECONDS_PER_METRE = 8.0;    // what a way counts for besides the time that it takes

  /** All that are tried: straight onto the goal's axis, or by one place on the way there. */
  std::vector<Places> ways() const
  {
    constexpr double ROOM_AHEAD = 0.6;  // beyond start and goal [m]
    constexpr double ROOM_ASIDE = 0.6;  // [m]
    constexpr double ON_AXIS = 0.03;    // as much as the last leg makes up for on its way [m]
    constexpr double ALONG_AXIS = 0.1;  // [rad]
    const double back = std::min(base_.x, 0.0) - params_.max_retreat;
    const double ahead = std::max(base_.x, 0.0) + ROOM_AHEAD;
    const double right = std::min(base_.y, 0.0) - ROOM_ASIDE;
    const double left = std::max(base_.y, 0.0) + ROOM_ASIDE;
    const double along = std::max(GRID, (ahead - back) / MOST_PLACES);
    const double across = std::max(GRID, (left - right) / MOST_PLACES);
    const Eigen::Vector2d goal = Eigen::Vector2d::Zero();
    std::vector<Places> all;
    if (std::abs(base_.y) <= ON_AXIS && std::abs(base_.yaw) <= ALONG_AXIS && std::abs(base_.x) >= params_.straight_end)
    {
      all.push_back({ goal });
    }
    for (double end = params_.straight_end; end <= std::max(-back, ahead); end += along)
    {
      for (const Eigen::Vector2d& last : { Eigen::Vector2d(-end, 0.0), Eigen::Vector2d(end, 0.0) })
      {
        if (last.x() < back || last.x() > ahead)
        {
          continue;
        }
        all.push_back({ last, goal });
        for (double x = back; x <= ahead; x += along)
        {
          for (double y = right; y <= left; y += across)
          {
            all.push_back({ Eigen::Vector2d(x, y), last, goal });
          }
        }
      }
    }
    return all;
  }

  double durationOf(const Manoeuvre& manoeuvre) const
  {
    constexpr double SPEED = 0.25;     // [m/s]
    constexpr double TURN_RATE = 0.4;  // [rad/s]
    constexpr double STOP = 1.0;       // speeding up and slowing down, at each leg [s]
    constexpr double REVERSAL = 3.0;   // wear, and play in the gears [s]
    double duration = 0.0;
    PlanarPose at = base_;
    const Leg* before = nullptr;
    for (const Leg& leg : manoeuvre.legs)
    {
      duration += STOP + std::abs(wrapAngle(leg.end.yaw - at.yaw)) / TURN_RATE + view_servo::lengthOf(at, leg) / SPEED;
      duration += before && before->backwards != leg.backwards ? REVERSAL : 0.0;
      at = leg.end;
      before = &leg;
    }
    return duration + std::abs(at.yaw) / TURN_RATE;
  }

  double lengthOf(const Manoeuvre& manoeuvre) const
  {
    double length = 0.0;
    PlanarPose at = base_;
    for (const Leg& leg : manoeuvre.legs)
    {
      length += view_servo::lengthOf(at, leg);
      at = leg.end;
    }
    return length;
  }

  double costOf(const Manoeuvre& manoeuvre) const
  {
    return manoeuvre.duration + SECONDS_PER_METRE * manoeuvre.length +
           SECONDS_PER_SHARE * std::max(0.0, params_.min_share - manoeuvre.least_share);
  }

  /** Fills in what is in sight on the way. @return whether it costs less than `least` and is not blind for too long. */
  bool lookAlong(Manoeuvre& manoeuvre, double least)
  {
    PlanarPose at = base_;
    for (const Leg& leg : manoeuvre.legs)
    {
      const PlanarPose turned{ at.x, at.y, leg.end.yaw };
      if (!lookAlong(at, turned, least, manoeuvre) || !lookAlong(turned, leg.end, least, manoeuvre))
      {
        return false;
      }
      at = leg.end;
    }
    return true;
  }

  /** The same of a turn or a straight way. */
  bool lookAlong(const PlanarPose& from, const PlanarPose& to, double least, Manoeuvre& manoeuvre)
  {
    constexpr double TURN_STEP = 0.15;  // between two looks [rad]
    constexpr double STEP = 0.25;       // [m]
    const double turn = wrapAngle(to.yaw - from.yaw);
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    const int steps = static_cast<int>(std::ceil(std::max(std::abs(turn) / TURN_STEP, length / STEP)));
    for (int i = 1; i <= steps; ++i)
    {
      const double part = static_cast<double>(i) / steps;
      ++looks_;
      const double share = share_(
          { from.x + part * (to.x - from.x), from.y + part * (to.y - from.y), wrapAngle(from.yaw + part * turn) });
      manoeuvre.least_share = std::min(manoeuvre.least_share, share);
      if (share < params_.blind_share)
      {
        manoeuvre.blind_distance += length / steps;
        manoeuvre.blind_turn += std::abs(turn) / steps;
      }
      if (costOf(manoeuvre) >= least || manoeuvre.blind_distance > params_.max_blind_distance ||
          manoeuvre.blind_turn > params_.max_blind_turn)
      {
        return false;
      }
    }
    return true;
  }

  const PlanarPose base_;
  const ShareInSight& share_;
  const ManoeuvreParams& params_;
  int looks_ = 0;  // at what is in sight
};

}  // namespace

std::vector<Parameter> parameters(ManoeuvreParams& params)
{
  return {
    real("min_share", params.min_share, "", "[0, 1]",
         "differential base: share of the view that is kept in sight, if there is a way that does"),
    real("max_blind_distance", params.max_blind_distance, "m", ">= 0",
         "differential base: longest way with hardly anything of the view in sight"),
    real("max_blind_turn", params.max_blind_turn, "rad", ">= 0",
         "differential base: largest angle that it turns with hardly anything of the view in sight"),
    real("max_retreat", params.max_retreat, "m", ">= 0",
         "differential base: how far it backs off beyond both where it is and where the view was stored"),
  };
}

Manoeuvre planManoeuvre(const PlanarPose& base_in_goal, const ShareInSight& share, const ManoeuvreParams& params)
{
  return Planner(base_in_goal, share, params).plan();
}

}  // namespace view_servo
