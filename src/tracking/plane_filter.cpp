// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_filter.h"

#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/faults.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace view_servo
{
std::vector<Parameter> parameters(PlaneFilterParams& params)
{
  return {
    real("window", params.window, "m", "> 0", "distance that the camera's positions of averaged measurements may span"),
    integer("max_measurements", params.max_measurements, "", ">= 2", "measurements averaged at most"),
    real("decision", params.decision, "", "> 1", "factor by which the wrong plane's normal must scatter more"),
  };
}

std::vector<std::string> PlaneFilterParams::validate() const
{
  return faultsOf(*this);
}

void PlaneFilter::Track::add(const EuclideanHomography& solution)
{
  const double information = solution.translation_over_distance.squaredNorm();
  normals += information * solution.normal;
  weight += information;
  ++count;
}

double PlaneFilter::Track::scatter() const
{
  // |sum| = weight times the mean cosine, about 1 - angle²/2.
  return weight > 0.0 ? std::max(0.0, 2.0 * (1.0 - normals.norm() / weight)) : 0.0;
}

PlaneFilter::PlaneFilter(const PlaneFilterParams& params) : params_(params)
{
  requireNoFaults("parameters of the plane filter", params.validate());
}

void PlaneFilter::add(const std::optional<Eigen::Isometry3d>& camera_in_odom, const Eigen::Matrix3d& h,
                      const Eigen::Matrix3d& k, const Points& seen)
{
  const Eigen::Matrix3d calibrated = calibratedHomography(h, k, seen);
  if (!calibrated.allFinite() || !(calibrated.determinant() > 0.0))
  {
    return;
  }
  followNormals(decomposeHomography(h, k, seen));  // none, as a rule, where the views agree
  const Measurement measurement{ camera_in_odom, calibrated };
  if (camera_in_odom && !measurements_.empty() && measurements_.back().camera_in_odom)
  {
    const Measurement& last = measurements_.back();
    if (!agrees(measurement, averaged_, *last.camera_in_odom))
    {
      if (!odd_ || !agrees(measurement, motionBefore(odd_->calibrated, normal()), *odd_->camera_in_odom))
      {
        odd_ = measurement;
        estimate_ = estimateOf(measurement);
        return;
      }
      measurements_.assign(1, *odd_);
      places_.assign(1, *odd_);
    }
  }
  odd_.reset();
  remember(measurement);
  average();
}

bool PlaneFilter::agrees(const Measurement& measurement, const EuclideanHomography& motion,
                         const Eigen::Isometry3d& camera_in_odom) const
{
  // Where the camera is mounted, and how far away the plane is, is not exact.
  constexpr double LEAST_ROTATION = 0.04;     // [rad]
  constexpr double LEAST_TRANSLATION = 0.06;  // of d
  constexpr double SCATTERS = 5.0;
  const Eigen::Isometry3d moved = measurement.camera_in_odom->inverse() * camera_in_odom;
  const std::optional<double> known = distance();
  const EuclideanHomography expected = movedOn(motion, moved, known.value_or(std::numeric_limits<double>::infinity()));
  const EuclideanHomography seen = motionBefore(measurement.calibrated, normal());
  const double turn = rotationVector(expected.rotation.transpose() * seen.rotation).norm();
  const double way = (expected.translation_over_distance - seen.translation_over_distance).norm();
  return turn <= std::max(LEAST_ROTATION, SCATTERS * rotation_scatter_) &&
         (!known || way <= std::max(LEAST_TRANSLATION, SCATTERS * translation_scatter_));
}

void PlaneFilter::followNormals(const std::vector<EuclideanHomography>& solutions)
{
  constexpr double LEAST_TRANSLATION = 0.03;  // over d: a shorter one does not tell the normal
  constexpr std::size_t FEWEST = 8;           // measurements before the scatter tells
  constexpr double NOISE = 1e-4;              // scatter that noise alone may have [rad²]
  constexpr double SAME_NORMAL = 0.9;         // cosine: a measurement further away is of neither
  std::vector<EuclideanHomography> usable;
  std::copy_if(solutions.begin(), solutions.end(), std::back_inserter(usable), [](const EuclideanHomography& solution) {
    return solution.normal.allFinite() && solution.translation_over_distance.norm() >= LEAST_TRANSLATION;
  });
  if (usable.empty())
  {
    return;
  }
  if (tracks_.empty())
  {
    for (const EuclideanHomography& solution : usable)
    {
      tracks_.emplace_back();
      tracks_.back().add(solution);
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
      tracks_[t].add(*of_track[t]);
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

void PlaneFilter::remember(const Measurement& measurement)
{
  constexpr double PLACES_IN_WINDOW = 20.0;
  constexpr std::size_t MOST_PLACES = 40;
  if (!measurement.camera_in_odom)
  {
    measurements_.assign(1, measurement);
    return;
  }
  const auto way_from = [&](const Measurement& other) {
    return (other.camera_in_odom->translation() - measurement.camera_in_odom->translation()).norm();
  };
  while (!measurements_.empty() &&
         (!measurements_.front().camera_in_odom || way_from(measurements_.front()) > params_.window ||
          measurements_.size() >= static_cast<std::size_t>(params_.max_measurements)))
  {
    measurements_.pop_front();
  }
  measurements_.push_back(measurement);
  if (places_.empty() || way_from(places_.back()) >= params_.window / PLACES_IN_WINDOW)
  {
    places_.push_back(measurement);
  }
  if (places_.size() > MOST_PLACES)
  {
    places_.pop_front();
  }
}

Eigen::Vector3d PlaneFilter::normal() const
{
  return tracks_.empty() ? Eigen::Vector3d(Eigen::Vector3d::UnitZ()) : tracks_.front().normal();
}

std::optional<double> PlaneFilter::distance() const
{
  double squared_way = 0.0;
  double change_by_way = 0.0;
  double farthest = 0.0;
  std::vector<EuclideanHomography> motions;
  for (const Measurement& place : places_)
  {
    motions.push_back(motionBefore(place.calibrated, normal()));
  }
  for (std::size_t i = 0; i < places_.size(); ++i)
  {
    for (std::size_t j = 0; j < i; ++j)
    {
      const Eigen::Isometry3d moved = places_[i].camera_in_odom->inverse() * *places_[j].camera_in_odom;
      const Eigen::Vector3d change =
          motions[i].translation_over_distance - moved.linear() * motions[j].translation_over_distance;
      squared_way += moved.translation().squaredNorm();
      change_by_way += change.dot(moved.translation());
      farthest = std::max(farthest, moved.translation().norm());
    }
  }
  if (tracks_.empty() || !(farthest >= params_.window) || !(change_by_way > 0.0))
  {
    return std::nullopt;
  }
  return squared_way / change_by_way;
}

PlaneEstimate PlaneFilter::estimateOf(const Measurement& last) const
{
  PlaneEstimate result;
  result.normal_known = !tracks_.empty();
  result.ambiguous = tracks_.size() > 1;
  result.distance = distance();
  result.motion = motionBefore(last.calibrated, normal());
  return result;
}

void PlaneFilter::average()
{
  const Measurement& last = measurements_.back();
  PlaneEstimate result = estimateOf(last);
  rotation_scatter_ = translation_scatter_ = 0.0;
  if (last.camera_in_odom)
  {
    const auto count = static_cast<double>(measurements_.size());
    Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
    Eigen::Vector3d translations = Eigen::Vector3d::Zero();
    std::vector<EuclideanHomography> motions;
    for (const Measurement& measurement : measurements_)
    {
      const Eigen::Isometry3d moved = last.camera_in_odom->inverse() * *measurement.camera_in_odom;
      motions.push_back(movedOn(motionBefore(measurement.calibrated, normal()), moved,
                                result.distance.value_or(std::numeric_limits<double>::infinity())));
      rotations += motions.back().rotation;
      translations += motions.back().translation_over_distance / count;
    }
    result.motion.rotation = nearestRotation(rotations);
    for (const EuclideanHomography& motion : motions)
    {
      rotation_scatter_ += rotationVector(result.motion.rotation.transpose() * motion.rotation).squaredNorm() / count;
      translation_scatter_ += (motion.translation_over_distance - translations).squaredNorm() / count;
    }
    rotation_scatter_ = std::sqrt(rotation_scatter_);
    translation_scatter_ = std::sqrt(translation_scatter_);
    // Without a distance, odometry does not tell how far the others have to be moved.
    if (result.distance)
    {
      result.motion.translation_over_distance = translations;
    }
  }
  averaged_ = result.motion;
  estimate_ = result;
}

}  // namespace view_servo
