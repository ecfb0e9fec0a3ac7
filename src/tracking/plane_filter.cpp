// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_filter.h"

#include "odometry_scale.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/faults.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace view_servo
{
namespace
{
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double INDEPENDENT = 50.0;  // points near each other err alike: no more than so many count
constexpr double AVERAGED = 15.0;     // likewise images from nearly the same place
constexpr double LEAST_SD = 0.1;      // of a point [px]

EuclideanHomography meanOf(const std::vector<EuclideanHomography>& motions)
{
  EuclideanHomography mean = motions.back();
  Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
  mean.translation_over_distance.setZero();
  for (const EuclideanHomography& motion : motions)
  {
    rotations += motion.rotation;
    mean.translation_over_distance += motion.translation_over_distance / static_cast<double>(motions.size());
  }
  mean.rotation = nearestRotation(rotations);
  return mean;
}

/** Covariance of a small rotation w, R' = exp(w) R, and of t / d, as noisy points of a plane of known normal tell it. */
Matrix6d noiseOf(const EuclideanHomography& motion, const Eigen::Matrix3d& k, const Points& seen, double rms)
{
  Matrix6d information = Matrix6d::Zero();
  const Eigen::Matrix3d inverse = k.inverse();
  for (const Eigen::Vector2d& point : seen)
  {
    const Eigen::Vector3d ray = inverse * point.homogeneous();
    const Eigen::Vector3d turned = motion.rotation * ray;
    const double inverse_depth = motion.normal.dot(ray);  // times d
    const Eigen::Vector3d at = turned + inverse_depth * motion.translation_over_distance;
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << 1.0, 0.0, -at.x() / at.z(), 0.0, 1.0, -at.y() / at.z();
    by_point = k.topLeftCorner<2, 2>() * by_point / at.z();
    Eigen::Matrix<double, 2, 6> by_motion;
    by_motion << -by_point * crossMatrix(turned), inverse_depth * by_point;
    information += by_motion.transpose() * by_motion;
  }
  const double sd = std::max(rms / std::sqrt(2.0), LEAST_SD);  // of one coordinate
  return sd * sd * information.inverse();
}

/** Covariance of motions about their mean, in the terms of noiseOf(). */
Matrix6d scatterOf(const std::vector<EuclideanHomography>& motions)
{
  const EuclideanHomography mean = meanOf(motions);
  Matrix6d scatter = Matrix6d::Zero();
  for (const EuclideanHomography& motion : motions)
  {
    Vector6d off;
    off << rotationVector(motion.rotation * mean.rotation.transpose()),
        motion.translation_over_distance - mean.translation_over_distance;
    scatter += off * off.transpose() / static_cast<double>(motions.size());
  }
  return scatter;
}

/** A symmetric matrix without its negative eigenvalues. */
Matrix6d positivePart(const Matrix6d& matrix)
{
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(matrix);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

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

double PlaneFilter::Track::deviation() const
{
  constexpr double ENOUGH = 100.0;  // images that err independently
  constexpr double OF_ONE = 0.02;   // scatter that one image hides, and few hide a part of [rad²]
  const double images = std::max(1.0, static_cast<double>(count));
  return std::sqrt(0.5 * (scatter() + OF_ONE / (images * images)) / std::min(ENOUGH, images));
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
  if (camera_in_odom && !measurements_.empty() && !measurements_.back().camera_in_odom && !places_.empty() &&
      !agrees(measurement, motionBefore(places_.back().calibrated, normal()), *places_.back().camera_in_odom))
  {
    places_.clear();  // odometry has begun anew while it was not there
  }
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
  const std::optional<OdometryScale> known = distance(normal());
  const EuclideanHomography expected =
      movedOn(motion, moved, known ? known->metres : std::numeric_limits<double>::infinity());
  const EuclideanHomography seen = motionBefore(measurement.calibrated, normal());
  const double turn = rotationVector(expected.rotation.transpose() * seen.rotation).norm();
  const double way = (expected.translation_over_distance - seen.translation_over_distance).norm();
  return turn <= std::max(LEAST_ROTATION, SCATTERS * rotation_scatter_) &&
         (!known || way <= std::max(LEAST_TRANSLATION, SCATTERS * translation_scatter_));
}

void PlaneFilter::followNormals(const std::vector<EuclideanHomography>& solutions)
{
  constexpr double LEAST_TRANSLATION = 0.03;  // over d: a shorter one does not tell the normal
  constexpr int FEWEST = 8;                   // measurements before the scatter tells
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
  const auto is_near = [&](const Track& track, const EuclideanHomography& solution) {
    return solution.normal.dot(track.normal()) > SAME_NORMAL;
  };
  const bool is_other = std::none_of(tracks_.begin(), tracks_.end(), [&](const Track& track) {
    return std::any_of(usable.begin(), usable.end(), [&](const auto& solution) { return is_near(track, solution); });
  });
  if (!is_other)
  {
    others_ = Track();
  }
  else if (!tracks_.empty())
  {
    others_.add(usable.front());
    if (others_.count >= FEWEST && others_.weight > tracks_.front().weight)
    {
      tracks_.clear();  // what was seen first, from too near to the view, was no normal
    }
  }
  if (tracks_.empty())
  {
    others_ = Track();
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

std::optional<OdometryScale> PlaneFilter::distance(const Eigen::Vector3d& normal) const
{
  std::vector<MeasuredWay> ways;
  ways.reserve(places_.size());
  for (const Measurement& place : places_)
  {
    ways.push_back({ motionBefore(place.calibrated, normal).translation_over_distance, *place.camera_in_odom });
  }
  if (tracks_.empty())
  {
    return std::nullopt;
  }
  // After a short way, too, where the images are so exact that it tells.
  constexpr double OF_WINDOW = 0.3;
  constexpr double LARGEST_DEVIATION = 0.04;
  const std::optional<OdometryScale> early = scaleByOdometry(ways, OF_WINDOW * params_.window);
  return early && early->relative_deviation <= LARGEST_DEVIATION ? early : scaleByOdometry(ways, params_.window);
}

PlaneEstimate PlaneFilter::estimateOf(const Measurement& last) const
{
  PlaneEstimate result;
  result.normal_known = !tracks_.empty();
  result.ambiguous = tracks_.size() > 1;
  if (const std::optional<OdometryScale> scale = distance(normal()))
  {
    result.distance = scale->metres;
  }
  result.motion = motionBefore(last.calibrated, normal());
  return result;
}

std::vector<EuclideanHomography> PlaneFilter::motionsNow(const Eigen::Vector3d& normal, double distance) const
{
  const Measurement& last = measurements_.back();
  std::vector<EuclideanHomography> motions;
  motions.reserve(measurements_.size());
  for (const Measurement& measurement : measurements_)
  {
    const Eigen::Isometry3d moved = last.camera_in_odom->inverse() * *measurement.camera_in_odom;
    motions.push_back(movedOn(motionBefore(measurement.calibrated, normal), moved, distance));
  }
  return motions;
}

void PlaneFilter::average()
{
  PlaneEstimate result = estimateOf(measurements_.back());
  rotation_scatter_ = translation_scatter_ = 0.0;
  if (measurements_.back().camera_in_odom)
  {
    const std::vector<EuclideanHomography> motions =
        motionsNow(normal(), result.distance.value_or(std::numeric_limits<double>::infinity()));
    const EuclideanHomography mean = meanOf(motions);
    const auto count = static_cast<double>(motions.size());
    result.motion.rotation = mean.rotation;
    for (const EuclideanHomography& motion : motions)
    {
      rotation_scatter_ += rotationVector(mean.rotation.transpose() * motion.rotation).squaredNorm() / count;
      translation_scatter_ += (motion.translation_over_distance - mean.translation_over_distance).squaredNorm() / count;
    }
    rotation_scatter_ = std::sqrt(rotation_scatter_);
    translation_scatter_ = std::sqrt(translation_scatter_);
    // Without a distance, odometry does not tell how far the others have to be moved.
    if (result.distance)
    {
      result.motion.translation_over_distance = mean.translation_over_distance;
    }
  }
  averaged_ = result.motion;
  estimate_ = result;
}

std::optional<CameraPose> PlaneFilter::cameraPose(const Eigen::Matrix3d& k, const Points& seen, double rms) const
{
  if (!estimate_ || !estimate_->distance || estimate_->ambiguous || odd_ || !measurements_.back().camera_in_odom)
  {
    return std::nullopt;
  }
  const Eigen::Vector3d towards = normal();
  const auto motion_with = [&](const Eigen::Vector3d& normal, double distance) {
    const EuclideanHomography mean = meanOf(motionsNow(normal, distance));
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = mean.rotation;
    motion.translation() = distance * mean.translation_over_distance;
    return motion;
  };
  const double away = *estimate_->distance;
  const Eigen::Isometry3d motion = motion_with(towards, away);
  const auto difference = [&](const Eigen::Isometry3d& other) {
    Vector6d change;
    change << rotationVector(other.linear() * motion.linear().transpose()), other.translation() - motion.translation();
    return change;
  };

  // What the motions scatter beyond the images' noise comes from odometry, and its last error is in all of them.
  const std::vector<EuclideanHomography> motions = motionsNow(towards, away);
  const Matrix6d noise = noiseOf({ motion.linear(), motion.translation() / away, towards }, k, seen, rms);
  Matrix6d covariance = std::max(1.0, static_cast<double>(seen.size()) / INDEPENDENT) * noise /
                            std::min(AVERAGED, static_cast<double>(motions.size())) +
                        positivePart(scatterOf(motions) - noise);
  covariance.bottomRows<3>() *= away;
  covariance.rightCols<3>() *= away;

  // A normal that is not exact makes the distance wrong, too, and both the motions.
  constexpr double SMALL = 1e-4;  // [rad]
  const double normal_deviation = tracks_.front().deviation();
  const Eigen::Vector3d across = towards.unitOrthogonal();
  for (const Eigen::Vector3d& aside : { across, Eigen::Vector3d(towards.cross(across)) })
  {
    const Eigen::Vector3d turned = (towards + SMALL * aside).normalized();
    const std::optional<OdometryScale> scale = distance(turned);
    const Vector6d change = difference(motion_with(turned, scale ? scale->metres : away)) / SMALL;
    covariance += normal_deviation * normal_deviation * change * change.transpose();
  }
  const double relative = distance(towards)->relative_deviation;
  const Vector6d change = difference(motion_with(towards, away * (1.0 + SMALL))) / SMALL;
  covariance += relative * relative * change * change.transpose();
  return cameraPoseAfter(motion, covariance);
}

}  // namespace view_servo
