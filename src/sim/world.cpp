// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/world.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
template <typename Value>
const Value& named(const std::map<std::string, Value>& all, const std::string& name, const std::string& what)
{
  const auto found = all.find(name);
  if (found != all.end())
  {
    return found->second;
  }
  std::string known;
  for (const auto& entry : all)
  {
    known += (known.empty() ? "" : ", ") + entry.first;
  }
  throw std::invalid_argument("there is no " + what + " '" + name + "'" + (known.empty() ? "" : ", only " + known));
}

}  // namespace

const Eigen::Isometry3d& World::start(const std::string& start_name) const
{
  return named(starts, start_name, "start");
}

const std::vector<Waypoint>& World::trajectory(const std::string& trajectory_name) const
{
  return named(trajectories, trajectory_name, "trajectory");
}

World withImageNoise(World world, double noise)
{
  if (noise >= 0.0)
  {
    world.quality.noise = noise;
  }
  return world;
}

World withObstaclesOf(World world, const std::vector<std::string>& groups)
{
  const auto is_away = [&](const Obstacle& obstacle) {
    return !obstacle.group.empty() && std::find(groups.begin(), groups.end(), obstacle.group) == groups.end();
  };
  std::vector<Obstacle>& all = world.obstacles;
  all.erase(std::remove_if(all.begin(), all.end(), is_away), all.end());
  return world;
}

Camera withFocalLengthError(Camera camera, double error)
{
  for (const int i : { 0, 1 })
  {
    camera.k(i, i) *= 1.0 + error;
    camera.projection(i, i) *= 1.0 + error;
  }
  return camera;
}

Eigen::Isometry3d planarPose(double x, double y, double yaw)
{
  Eigen::Isometry3d pose(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  pose.translation() << x, y, 0.0;
  return pose;
}

double yawOf(const Eigen::Isometry3d& pose)
{
  return std::atan2(pose.linear()(1, 0), pose.linear()(0, 0));
}

Eigen::Isometry3d lookingAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target, double roll)
{
  const Eigen::Vector3d z = (target - position).normalized();
  Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ());
  // Straight up or down no x axis is less level than another.
  x = x.norm() > 1e-6 ? x.normalized() : Eigen::Vector3d(-Eigen::Vector3d::UnitY());
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear().col(0) = x;
  pose.linear().col(1) = z.cross(x);
  pose.linear().col(2) = z;
  pose.linear() = pose.linear() * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  pose.translation() = position;
  return pose;
}

std::string touchedObstacle(const World& world, const Eigen::Vector2d& centre, double radius)
{
  for (const Obstacle& obstacle : world.obstacles)
  {
    bool inside = true;
    double distance = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < obstacle.outline.size(); ++i)
    {
      const Eigen::Vector2d& from = obstacle.outline[i];
      const Eigen::Vector2d side = obstacle.outline[(i + 1) % obstacle.outline.size()] - from;
      const Eigen::Vector2d offset = centre - from;
      inside = inside && side.x() * offset.y() - side.y() * offset.x() >= 0.0;
      const double along = std::clamp(offset.dot(side) / side.squaredNorm(), 0.0, 1.0);
      distance = std::min(distance, (offset - along * side).norm());
    }
    if (inside || distance < radius)
    {
      return obstacle.name.empty() ? "an obstacle" : obstacle.name;
    }
  }
  return "";
}

Eigen::Isometry3d poseAt(const std::vector<Waypoint>& trajectory, double time)
{
  const auto next = std::find_if(trajectory.begin(), trajectory.end(),
                                 [time](const Waypoint& waypoint) { return waypoint.time > time; });
  if (next == trajectory.begin())
  {
    return next->pose;
  }
  const auto last = std::prev(next);
  if (next == trajectory.end())
  {
    return last->pose;
  }
  const double share = (time - last->time) / (next->time - last->time);
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(last->pose.linear()).slerp(share, Eigen::Quaterniond(next->pose.linear()));
  Eigen::Isometry3d pose(turn);
  pose.translation() = (1.0 - share) * last->pose.translation() + share * next->pose.translation();
  return pose;
}

}  // namespace view_servo::sim
