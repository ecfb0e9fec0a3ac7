// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "hand_eye_problem.h"

#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/rotation_vector.h"

#include <Eigen/LU>

#include <algorithm>

namespace view_servo::hand_eye
{
namespace
{
constexpr double EXACT = 1e10;  // one over the square of 1e-5, for one pixel of error in images

/** Two unit vectors square to a unit vector and to each other, as columns. */
Eigen::Matrix<double, 3, 2> squareTo(const Eigen::Vector3d& unit)
{
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = unit.unitOrthogonal();
  basis.col(1) = unit.cross(basis.col(0));
  return basis;
}

/** A ray, z = 1, of a camera whose focal lengths are so many times as long. */
Eigen::Vector3d scaledRay(const Eigen::Vector3d& ray, double focal_scale)
{
  return { ray.x() / focal_scale, ray.y() / focal_scale, 1.0 };
}

}  // namespace

Eigen::Matrix3d withFocalScale(const Eigen::Matrix3d& k, double scale)
{
  Eigen::Matrix3d scaled = k;
  scaled.leftCols<2>() *= scale;
  return scaled;
}

State moved(const State& state, const Eigen::VectorXd& step)
{
  State next = state;
  next.camera_in_flange.translation() += step.segment<3>(0);
  next.camera_in_flange.linear() = rotationFromVector(step.segment<3>(3)) * state.camera_in_flange.linear();
  next.view_in_base.translation() += step.segment<3>(6);
  next.view_in_base.linear() = rotationFromVector(step.segment<3>(9)) * state.view_in_base.linear();
  next.normal = (state.normal + squareTo(state.normal) * step.segment<2>(12)).normalized();
  next.distance = state.distance * std::exp(step(DISTANCE));
  next.focal_scale = state.focal_scale * std::exp(step(FOCAL_LENGTH));
  return next;
}

Problem::Problem(const HandEyeView& view, const std::vector<HandEyePose>& poses, double distance,
                 bool knows_focal_length)
  : view_(view), known_distance_(distance), knows_focal_length_(knows_focal_length)
{
  const Eigen::Matrix3d inverse = view.k.inverse();
  for (const Eigen::Vector2d& corner : view.corners)
  {
    rays_.emplace_back(inverse * corner.homogeneous());
  }
  for (const HandEyePose& pose : poses)
  {
    Observation observation;
    observation.base_in_flange = pose.flange_in_base.inverse();
    observation.calibrated = calibratedHomography(pose.h, view.k, view.corners);
    observation.corners.resize(ROWS);
    for (int i = 0; i < CORNERS; ++i)
    {
      observation.corners.segment<2>(2 * i) =
          (view.k * observation.calibrated * rays_[static_cast<std::size_t>(i)]).hnormalized();
    }
    observations_.push_back(observation);
    decompositions_.push_back(decomposeHomography(pose.h, view.k, view.corners));
  }
}

std::vector<Eigen::Vector3d> Problem::normals() const
{
  constexpr double FAR = 0.35;   // an angle beyond which homographies just disagree [rad]
  constexpr double SAME = 0.25;  // between two answers that are one [rad]
  struct Vote
  {
    Eigen::Vector3d normal;
    double cost;
  };
  std::vector<Vote> votes;
  for (const auto& candidates : decompositions_)
  {
    for (const EuclideanHomography& candidate : candidates)
    {
      if (!candidate.normal.allFinite())
      {
        continue;
      }
      double cost = 0.0;
      for (const auto& others : decompositions_)
      {
        double least = FAR;
        for (const EuclideanHomography& other : others)
        {
          if (other.normal.allFinite())
          {
            least = std::min(least, std::acos(std::clamp(candidate.normal.dot(other.normal), -1.0, 1.0)));
          }
        }
        cost += least;
      }
      votes.push_back({ candidate.normal, cost });
    }
  }
  std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return a.cost < b.cost; });
  std::vector<Eigen::Vector3d> result;
  for (const Vote& vote : votes)
  {
    if (result.empty() || (result.size() == 1 && result.front().dot(vote.normal) < std::cos(SAME)))
    {
      result.push_back(vote.normal);
    }
  }
  return result;
}

std::vector<EuclideanHomography> Problem::motionsBefore(const Eigen::Vector3d& normal) const
{
  std::vector<EuclideanHomography> motions;
  for (const Observation& observation : observations_)
  {
    motions.push_back(motionBefore(observation.calibrated, normal));
  }
  return motions;
}

bool Problem::errors(const State& state, std::size_t i, Eigen::VectorXd& errors) const
{
  return this->errors(state, i, observations_[i].base_in_flange, errors);
}

bool Problem::errors(const State& state, std::size_t i, const Eigen::Isometry3d& base_in_flange,
                     Eigen::VectorXd& errors) const
{
  errors.resize(ROWS);
  const Eigen::Matrix3d k = withFocalScale(view_.k, state.focal_scale);
  const Eigen::Isometry3d camera_from_view = state.camera_in_flange.inverse() * base_in_flange * state.view_in_base;
  for (int corner = 0; corner < CORNERS; ++corner)
  {
    const Eigen::Vector3d ray = scaledRay(rays_[static_cast<std::size_t>(corner)], state.focal_scale);
    const double facing = state.normal.dot(ray);
    const Eigen::Vector3d point = camera_from_view * Eigen::Vector3d(ray * (state.distance / facing));
    if (!(facing > 0.0) || !(point.z() > 0.0))
    {
      return false;
    }
    errors.segment<2>(2 * corner) = (k * point).hnormalized() - observations_[i].corners.segment<2>(2 * corner);
  }
  return errors.allFinite();
}

double Problem::squaredError(const State& state, std::size_t i) const
{
  Eigen::VectorXd difference;
  return errors(state, i, difference) ? difference.squaredNorm() / CORNERS : ENDLESS;
}

void Problem::linearize(const State& state, std::size_t i, Eigen::MatrixXd& by_state, Eigen::MatrixXd& by_arm) const
{
  linearize(state, observations_[i].base_in_flange, by_state, by_arm);
}

void Problem::linearize(const State& state, const Eigen::Isometry3d& base_in_flange, Eigen::MatrixXd& by_state,
                        Eigen::MatrixXd& by_arm) const
{
  by_state.resize(ROWS, DOF);
  by_arm.resize(ROWS, 6);
  const Eigen::Matrix3d camera_from_flange = state.camera_in_flange.linear().transpose();
  const Eigen::Matrix3d camera_from_base = camera_from_flange * base_in_flange.linear();
  const Eigen::Matrix<double, 3, 2> basis = squareTo(state.normal);
  const Eigen::Matrix3d k = withFocalScale(view_.k, state.focal_scale);
  for (int corner = 0; corner < CORNERS; ++corner)
  {
    const Eigen::Vector3d ray = scaledRay(rays_[static_cast<std::size_t>(corner)], state.focal_scale);
    const double facing = state.normal.dot(ray);
    const Eigen::Vector3d in_view = ray * (state.distance / facing);
    const Eigen::Vector3d turned = state.view_in_base.linear() * in_view;
    const Eigen::Vector3d in_flange = base_in_flange * (state.view_in_base * in_view);
    const Eigen::Vector3d in_camera = state.camera_in_flange.inverse() * in_flange;

    const Eigen::Vector3d pixel = k * in_camera;
    Eigen::Matrix<double, 2, 3> projection;
    projection << k.row(0) / pixel.z() - k.row(2) * (pixel.x() / (pixel.z() * pixel.z())),
        k.row(1) / pixel.z() - k.row(2) * (pixel.y() / (pixel.z() * pixel.z()));

    Eigen::Matrix<double, 3, DOF> point;
    point.block<3, 3>(0, 0) = -camera_from_flange;
    point.block<3, 3>(0, 3) = camera_from_flange * crossMatrix(in_flange - state.camera_in_flange.translation());
    point.block<3, 3>(0, 6) = camera_from_base;
    point.block<3, 3>(0, 9) = -camera_from_base * crossMatrix(turned);
    const Eigen::Vector3d farther = camera_from_base * turned;
    point.col(12) = farther * (-ray.dot(basis.col(0)) / facing);
    point.col(13) = farther * (-ray.dot(basis.col(1)) / facing);
    point.col(DISTANCE) = farther;
    // A longer focal length moves the corner on the plane of the view, and then the point's picture.
    const Eigen::Vector3d ray_change(-ray.x(), -ray.y(), 0.0);
    const Eigen::Vector3d on_plane =
        (ray_change - ray * (state.normal.dot(ray_change) / facing)) * (state.distance / facing);
    point.col(FOCAL_LENGTH) = camera_from_base * state.view_in_base.linear() * on_plane;
    by_state.middleRows<2>(2 * corner) = projection * point;
    const Eigen::Vector3d beside_axis = k * Eigen::Vector3d(in_camera.x(), in_camera.y(), 0.0);
    by_state.block<2, 1>(2 * corner, FOCAL_LENGTH) += beside_axis.head<2>() / in_camera.z();

    Eigen::Matrix<double, 3, 6> moved;
    moved.leftCols<3>() = -camera_from_flange;
    moved.rightCols<3>() = camera_from_flange * crossMatrix(in_flange);
    by_arm.middleRows<2>(2 * corner) = projection * moved;
  }
}

double Problem::distanceWeight() const
{
  return std::isnan(known_distance_) ? 0.0 : EXACT;
}

double Problem::focalLengthWeight() const
{
  return knows_focal_length_ ? EXACT : 0.0;
}

int Problem::knownUnknowns() const
{
  return (distanceWeight() > 0.0 ? 1 : 0) + (knows_focal_length_ ? 1 : 0);
}

double Problem::distanceError(const State& state) const
{
  return std::isnan(known_distance_) ? 0.0 : std::log(state.distance / known_distance_);
}

double medianOf(std::vector<double> values)
{
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace view_servo::hand_eye
