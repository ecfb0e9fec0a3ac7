// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/odometry_history.h"

#include <algorithm>

namespace view_servo
{
namespace
{
/** On the straight line from one pose to another, 0 = there, 1 = here; also beyond. */
PlanarPose between(const PlanarPose& from, const PlanarPose& to, double part)
{
  return { from.x + part * (to.x - from.x), from.y + part * (to.y - from.y),
           wrapAngle(from.yaw + part * wrapAngle(to.yaw - from.yaw)) };
}

}  // namespace

bool OdometryHistory::add(double stamp, const PlanarPose& pose)
{
  if (!entries_.empty() && stamp <= entries_.back().stamp)
  {
    const auto next = std::lower_bound(entries_.begin(), entries_.end(), stamp,
                                       [](const Entry& entry, double time) { return entry.stamp < time; });
    if (next->stamp != stamp && next != entries_.begin())
    {
      entries_.insert(next, { stamp, pose });
    }
    return false;
  }
  entries_.push_back({ stamp, pose });
  while (entries_.front().stamp < stamp - duration_)
  {
    entries_.pop_front();
  }
  return true;
}

std::optional<PlanarPose> OdometryHistory::at(double stamp, double reach) const
{
  if (entries_.empty() || stamp < entries_.front().stamp || stamp > entries_.back().stamp + reach)
  {
    return std::nullopt;
  }
  if (entries_.size() == 1)
  {
    return entries_.front().pose;
  }
  if (stamp > entries_.back().stamp)
  {
    // By poses that are some way apart: of two that came in a burst the rounding would be extrapolated.
    constexpr double APART = 0.05;  // [s]
    const Entry& newest = entries_.back();
    auto before = entries_.end() - 2;
    while (before != entries_.begin() && newest.stamp - before->stamp < APART)
    {
      --before;
    }
    return between(before->pose, newest.pose, (stamp - before->stamp) / (newest.stamp - before->stamp));
  }
  auto after = std::lower_bound(entries_.begin(), entries_.end(), stamp,
                                [](const Entry& entry, double time) { return entry.stamp < time; });
  after = std::clamp(after, entries_.begin() + 1, entries_.end() - 1);
  const Entry& a = *(after - 1);
  const Entry& b = *after;
  return between(a.pose, b.pose, (stamp - a.stamp) / (b.stamp - a.stamp));
}

std::optional<PlanarPose> OdometryHistory::newest() const
{
  return entries_.empty() ? std::nullopt : std::optional<PlanarPose>(entries_.back().pose);
}

}  // namespace view_servo
