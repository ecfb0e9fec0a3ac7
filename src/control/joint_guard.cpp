// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/joint_guard.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double STANDS = 1e-3;  // [rad/s] or [m/s]
}  // namespace

JointGuard::JointGuard(std::map<std::string, JointLimits> limits, double margin, double max_age)
  : limits_(std::move(limits)), margin_(margin), max_age_(max_age)
{
}

void JointGuard::begin(std::set<std::string> carrying)
{
  carrying_ = std::move(carrying);
  joints_.clear();
  clearStuck();
}

bool JointGuard::tells(const std::vector<std::string>& names, const std::vector<double>& positions) const
{
  const bool any = !carrying_ || carrying_->empty();
  for (std::size_t i = 0; i < names.size() && i < positions.size(); ++i)
  {
    if (limits_.count(names[i]) > 0 && (any || carrying_->count(names[i]) > 0))
    {
      return true;
    }
  }
  return false;
}

bool JointGuard::watched(const std::string& name, const Joint& joint) const
{
  constexpr double MOVED = 2e-3;  // [rad] or [m]
  if (!carrying_)
  {
    return true;
  }
  return carrying_->empty() ? std::abs(joint.position - joint.first) > MOVED : carrying_->count(name) > 0;
}

std::string JointGuard::silent(double time) const
{
  const auto found = std::find_if(joints_.begin(), joints_.end(), [&](const auto& entry) {
    return time - entry.second.time > max_age_ && watched(entry.first, entry.second);
  });
  return found == joints_.end() ? "" : found->first;
}

std::string JointGuard::add(double time, const std::vector<std::string>& names, const std::vector<double>& positions,
                            const std::vector<double>& velocities)
{
  constexpr double BEYOND = 0.1;  // of the range, where an arm can hardly be
  std::string unbelievable;
  for (std::size_t i = 0; i < names.size() && i < positions.size(); ++i)
  {
    const auto limits = limits_.find(names[i]);
    if (limits == limits_.end())
    {
      continue;
    }
    const auto [lower, upper] = limits->second;
    const double beyond = std::max(margin_, BEYOND * (upper - lower));
    if (!(positions[i] >= lower - beyond && positions[i] <= upper + beyond))
    {
      char text[100];
      std::snprintf(text, sizeof(text), "' is said to be at %.3g, its limits are %.3g and %.3g", positions[i], lower,
                    upper);
      unbelievable = "joint '" + names[i] + text;
      continue;
    }
    const auto before = joints_.find(names[i]);
    Joint joint{ time, positions[i], 0.0, before == joints_.end() ? positions[i] : before->second.first };
    if (velocities.size() == positions.size() && std::isfinite(velocities[i]))  // NaN: it is not known (REP 117)
    {
      joint.velocity = velocities[i];
    }
    else if (before != joints_.end() && time > before->second.time)
    {
      joint.velocity = (joint.position - before->second.position) / (time - before->second.time);
    }
    joints_[names[i]] = joint;
    last_motion_ = std::abs(joint.velocity) > STANDS ? time : last_motion_;
  }
  return unbelievable;
}

std::string JointGuard::problem(double time)
{
  constexpr double PATIENCE = 0.15;  // [s]
  constexpr double BLOCKED = 1.0;    // that no joint moves at all [s]
  last_motion_ = is_told_ ? last_motion_ : time;
  is_told_ = true;
  const bool is_blocked = carrying_ && carrying_->empty() && time - last_motion_ > BLOCKED;
  std::string worst;
  for (const auto& [name, joint] : joints_)
  {
    const JointLimits& limits = limits_.at(name);
    const bool low = joint.position < limits.lower + margin_;
    const bool high = joint.position > limits.upper - margin_;
    const double outwards = low ? -joint.velocity : joint.velocity;
    const bool old = time - joint.time > max_age_;
    if (old || (!low && !high) || outwards < -STANDS || !(is_blocked || watched(name, joint)))
    {
      stuck_since_.erase(name);
      continue;
    }
    const double since = stuck_since_.emplace(name, time).first->second;
    if (outwards > STANDS || time - since > PATIENCE)
    {
      char text[60];
      std::snprintf(text, sizeof(text), "' is at %.3f, its limit is %.3f", joint.position,
                    low ? limits.lower : limits.upper);
      worst = "joint limit reached: '" + name + text;
    }
  }
  return worst;
}

void JointGuard::clearStuck()
{
  is_told_ = false;
  stuck_since_.clear();
}

}  // namespace view_servo
