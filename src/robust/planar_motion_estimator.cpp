// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/planar_motion_estimator.h"

#include "view_servo/geometry/fundamental.h"

#include <Eigen/LU>

#include <cmath>
#include <limits>

namespace view_servo
{
bool PlanarMotionEstimator::accepts(const std::vector<int>& sample) const
{
  // A point near the horizon in both views says nothing: every epipole is on it.
  constexpr double MIN_HEIGHT = 0.02;
  for (const int i : sample)
  {
    const Correspondence& pair = pairs_[static_cast<std::size_t>(i)];
    if (std::abs(pair.reference.y()) + std::abs(pair.current.y()) < MIN_HEIGHT)
    {
      return false;
    }
  }
  return true;
}

void PlanarMotionEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  for (const PlanarPose& pose : planarMotionFromTwoPoints(pairs_[static_cast<std::size_t>(sample[0])],
                                                          pairs_[static_cast<std::size_t>(sample[1])]))
  {
    if (std::abs(pose.yaw) <= max_yaw_)
    {
      models.emplace_back(pose);
    }
  }
}

double PlanarMotionEstimator::error(const Model& model, std::size_t i) const
{
  // A noisy point far away may come out slightly behind the camera.
  constexpr double NEARLY_INFINITE = -0.02;  // [1 / distance moved]
  if (inverseDepth(pairs_[i], model.rotation, model.translation).value < NEARLY_INFINITE)
  {
    return std::numeric_limits<double>::infinity();
  }
  return sampsonError(model.essential, pairs_[i]);
}

std::optional<PlanarMotionEstimator::Model> PlanarMotionEstimator::refit(const Model& model,
                                                                         const std::vector<int>& inliers) const
{
  const PlanarPose refined = refinePlanarMotion(model.pose, select(pairs_, inliers));
  return std::abs(refined.yaw) <= max_yaw_ ? std::optional<Model>(refined) : std::nullopt;
}

bool PlanarPoseEstimator::accepts(const std::vector<int>& /*sample*/) const
{
  return true;
}

void PlanarPoseEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  // Linear in (cos yaw, sin yaw, x, y): two rows a sighting.
  constexpr double MAX_STRETCH = 1.2;  // of the rotation, by which noise may break its norm
  Eigen::Matrix4d a;
  Eigen::Vector4d b;
  for (int k = 0; k < 2; ++k)
  {
    const Sighting& sighting = sightings_[static_cast<std::size_t>(sample[static_cast<std::size_t>(k)])];
    const double x = sighting.landmark.reference.x();
    const double y = sighting.landmark.reference.y();
    const double rho = sighting.landmark.inverse_depth;
    const double u = sighting.current.x();
    const double v = sighting.current.y();
    a.row(2 * k) << x - u, -1.0 - u * x, -u * rho, -rho;
    a.row(2 * k + 1) << v, v * x, v * rho, 0.0;
    b.segment<2>(2 * k) << 0.0, y;
  }
  const Eigen::FullPivLU<Eigen::Matrix4d> lu(a);
  if (!lu.isInvertible())
  {
    return;
  }
  const Eigen::Vector4d solution = lu.solve(b);
  const double stretch = std::hypot(solution(0), solution(1));
  if (stretch < MAX_STRETCH && stretch > 1.0 / MAX_STRETCH)
  {
    models.push_back({ solution(2) / stretch, solution(3) / stretch, std::atan2(solution(1), solution(0)) });
  }
}

double PlanarPoseEstimator::error(const Model& model, std::size_t i) const
{
  const double squared = (project(sightings_[i].landmark, model) - sightings_[i].current).squaredNorm();
  return std::isnan(squared) ? std::numeric_limits<double>::infinity() : squared;
}

std::optional<PlanarPoseEstimator::Model> PlanarPoseEstimator::refit(const Model& model,
                                                                     const std::vector<int>& inliers) const
{
  std::vector<Sighting> supporting;
  supporting.reserve(inliers.size());
  for (const int i : inliers)
  {
    supporting.push_back(sightings_[static_cast<std::size_t>(i)]);
  }
  return refinePlanarPose(model, supporting, width_);
}

}  // namespace view_servo
