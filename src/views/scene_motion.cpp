// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/scene_motion.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/relative_pose_estimator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
void requireUsable(const Camera& camera, const std::string& name)
{
  const std::string fault = camera.fault();
  if (!fault.empty())
  {
    throw std::invalid_argument("the " + name + " camera: " + fault);
  }
}

double meanFocalLength(const Camera& camera)
{
  return 0.5 * (camera.k(0, 0) + camera.k(1, 1));
}

}  // namespace

std::optional<SceneMotion> sceneMotion(const ViewMatch& match, const Camera& reference, const Camera& current)
{
  constexpr std::size_t FEWEST = 15;
  constexpr double THRESHOLD = 1.5;  // of a match that agrees [px]
  constexpr double NOISE = 0.3;      // least standard deviation of a match [px]
  // Lenses and shutters are never quite as calibrated: matches of one part of the picture err alike. On real walks
  // motions err as if so many matches were independent, however many there are.
  constexpr double INDEPENDENT = 9.0;
  requireUsable(reference, "reference");
  requireUsable(current, "current");
  if (match.outcome != MatchOutcome::MATCHED || match.model != GeometryModel::FUNDAMENTAL)
  {
    return std::nullopt;
  }
  Correspondences pairs;
  for (const MatchedPoint& point : match.matches)
  {
    const Correspondence pair{ reference.normalized(point.position.reference),
                               current.normalized(point.position.current) };
    if (point.inlier && pair.reference.allFinite() && pair.current.allFinite())
    {
      pairs.push_back(pair);
    }
  }
  if (pairs.size() < FEWEST)
  {
    return std::nullopt;
  }
  const double pixel = 2.0 / (meanFocalLength(reference) + meanFocalLength(current));
  RansacParams params;
  params.inlier_threshold = THRESHOLD * pixel;
  params.sampling = Sampling::UNIFORM;
  params.max_iterations = 1000;
  Rng rng(1);
  const auto found = ransac(RelativePoseEstimator(pairs), params, rng);
  if (!found.model || found.inliers.size() < FEWEST)
  {
    return std::nullopt;
  }
  const Correspondences agreeing = select(pairs, found.inliers);
  SceneMotion motion;
  motion.pose = refineRelativePose(found.model->pose, agreeing);
  motion.inliers = agreeing.size();
  const Eigen::Matrix3d essential = motion.pose.essential();
  double squares = 0.0;
  for (const Correspondence& pair : agreeing)
  {
    squares += sampsonError(essential, pair);
  }
  const double count = static_cast<double>(agreeing.size());
  const double variance = std::max(squares / count, NOISE * NOISE * pixel * pixel);
  motion.covariance = covarianceOf(motion.pose, agreeing, variance * count / INDEPENDENT);
  return motion;
}

}  // namespace view_servo
