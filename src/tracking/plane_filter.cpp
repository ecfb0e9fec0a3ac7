// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_filter.h"

#include "view_servo/geometry/faults.h"

#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace view_servo
{
namespace
{
/** The rotation nearest to a sum of rotations (orthogonal Procrustes). */
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& sum)
{
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d signs = Eigen::Matrix3d::Identity();
  signs(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * signs * svd.matrixV().transpose();
}

bool hasNormal(const EuclideanHomography& solution)
{
  return solution.normal.allFinite();
}

}  // namespace

std::vector<std::string> PlaneFilterParams::validate() const
{
  Faults faults;
  faults.require(window > 0.0, "window must be more than 0 m");
  faults.require(max_measurements >= 2, "max_measurements must be at least 2");
  faults.require(decision > 1.0, "decision must be more than 1");
  return faults.list();
}

double PlaneFilter::Track::scatter() const
{
  // |sum| = count times the mean cosine, about 1 - angle²/2.
  return count == 0 ? 0.0 : std::max(0.0, 2.0 * (1.0 - normals.norm() / static_cast<double>(count)));
}

PlaneFilter::PlaneFilter(const PlaneFilterParams& params) : params_(params)
{
  requireNoFaults("parameters of the plane filter", params.validate());
}

void PlaneFilter::append(Track& track, const Measurement& measurement) const
{
  track.normals += measurement.motion.normal;
  ++track.count;
  if (!track.measurements.empty())
  {
    const Eigen::Isometry3d last_in_this =
        measurement.camera_in_odom.inverse() * track.measurements.back().camera_in_odom;
    track.way += last_in_this.translation().norm();
    // The equations of d between this measurement and those of the window.
    for (const Measurement& earlier : track.measurements)
    {
      const Eigen::Isometry3d moved = measurement.camera_in_odom.inverse() * earlier.camera_in_odom;
      const Eigen::Vector3d change =
          measurement.motion.translation_over_distance - moved.linear() * earlier.motion.translation_over_distance;
      track.squared_way += moved.translation().squaredNorm();
      track.change_by_way += change.dot(moved.translation());
    }
  }
  track.measurements.push_back(measurement);
  const auto too_far = [&] {
    const Eigen::Vector3d way =
        measurement.camera_in_odom.translation() - track.measurements.front().camera_in_odom.translation();
    return way.norm() > params_.window;
  };
  while (track.measurements.size() > 2 &&
         (too_far() || track.measurements.size() > static_cast<std::size_t>(params_.max_measurements)))
  {
    track.measurements.pop_front();
  }
}

void PlaneFilter::add(const Eigen::Isometry3d& camera_in_odom, const std::vector<EuclideanHomography>& solutions)
{
  constexpr std::size_t FEWEST = 8;    // measurements before the scatter tells
  constexpr double NOISE = 1e-4;       // scatter that noise alone may have [rad²]
  constexpr double SAME_NORMAL = 0.9;  // cosine: a measurement further away is of neither
  std::vector<EuclideanHomography> usable;
  std::copy_if(solutions.begin(), solutions.end(), std::back_inserter(usable), hasNormal);
  if (usable.empty())
  {
    return;
  }
  if (tracks_.empty())
  {
    for (const EuclideanHomography& solution : usable)
    {
      tracks_.emplace_back();
      append(tracks_.back(), { camera_in_odom, solution });
    }
    // Until something tells: the plane that faces the camera more.
    std::stable_sort(tracks_.begin(), tracks_.end(),
                     [](const Track& a, const Track& b) { return a.normal().z() > b.normal().z(); });
    return;
  }
  // Each solution to the track with the nearest normal; a track without one is the decomposition that is not seen.
  std::vector<const EuclideanHomography*> of_track(tracks_.size(), nullptr);
  for (std::size_t t = 0; t < tracks_.size(); ++t)
  {
    double best = SAME_NORMAL;
    for (const EuclideanHomography& solution : usable)
    {
      const double cosine = solution.normal.dot(tracks_[t].normal());
      if (cosine > best)
      {
        best = cosine;
        of_track[t] = &solution;
      }
    }
  }
  if (tracks_.size() == 2 && of_track[0] != nullptr && of_track[0] == of_track[1])
  {
    // Both are near to one: it belongs to the nearer.
    const bool to_first = of_track[0]->normal.dot(tracks_[0].normal()) >= of_track[0]->normal.dot(tracks_[1].normal());
    of_track[to_first ? 1 : 0] = nullptr;
  }
  for (std::size_t t = 0; t < tracks_.size(); ++t)
  {
    if (of_track[t] != nullptr)
    {
      append(tracks_[t], { camera_in_odom, *of_track[t] });
    }
  }
  if (tracks_.size() < 2)
  {
    return;
  }
  const Track& a = tracks_[0];
  const Track& b = tracks_[1];
  const auto unseen = [](const Track& seen, const Track& other) {
    return seen.count >= other.count + FEWEST;
  };
  const auto wanders = [&](const Track& steady, const Track& other) {
    return std::min(steady.count, other.count) >= FEWEST &&
           other.scatter() > params_.decision * std::max(steady.scatter(), NOISE);
  };
  if (unseen(a, b) || wanders(a, b))
  {
    tracks_.pop_back();
  }
  else if (unseen(b, a) || wanders(b, a))
  {
    tracks_.erase(tracks_.begin());
  }
}

std::optional<PlaneEstimate> PlaneFilter::estimate() const
{
  if (tracks_.empty())
  {
    return std::nullopt;
  }
  const Track& track = tracks_.front();
  PlaneEstimate result;
  result.ambiguous = tracks_.size() > 1;
  result.motion.normal = track.normal();
  if (track.way >= params_.window && track.squared_way > 0.0 && track.change_by_way > 0.0)
  {
    result.distance = track.squared_way / track.change_by_way;
  }
  const Measurement& last = track.measurements.back();
  Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translations = Eigen::Vector3d::Zero();
  for (const Measurement& measurement : track.measurements)
  {
    const Eigen::Isometry3d moved = last.camera_in_odom.inverse() * measurement.camera_in_odom;
    rotations += moved.linear() * measurement.motion.rotation;
    if (result.distance)
    {
      translations +=
          moved.linear() * measurement.motion.translation_over_distance + moved.translation() / *result.distance;
    }
  }
  result.motion.rotation = nearestRotation(rotations);
  // Without a distance, odometry does not tell how far the others have to be moved.
  result.motion.translation_over_distance =
      result.distance ? Eigen::Vector3d(translations / static_cast<double>(track.measurements.size()))
                      : last.motion.translation_over_distance;
  return result;
}

}  // namespace view_servo
