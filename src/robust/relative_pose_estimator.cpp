// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/relative_pose_estimator.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/planar_motion.h"

#include <algorithm>
#include <limits>

namespace view_servo
{
void RelativePoseEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  const Correspondences five = select(pairs_, sample);
  for (const Eigen::Matrix3d& essential : essentialFromFivePoints(five))
  {
    for (const RelativePose& pose : posesFromEssential(essential))
    {
      if (std::all_of(five.begin(), five.end(), [&pose](const Correspondence& pair) {
            return inverseDepth(pair, pose.rotation, pose.translation).value > 0.0;
          }))
      {
        models.push_back({ pose, pose.essential() });
      }
    }
  }
}

double RelativePoseEstimator::error(const Model& model, std::size_t i) const
{
  // A noisy point far away may come out slightly behind the camera.
  constexpr double NEARLY_INFINITE = -0.02;  // [1 / distance moved]
  if (inverseDepth(pairs_[i], model.pose.rotation, model.pose.translation).value < NEARLY_INFINITE)
  {
    return std::numeric_limits<double>::infinity();
  }
  return sampsonError(model.essential, pairs_[i]);
}

std::optional<RelativePoseEstimator::Model> RelativePoseEstimator::refit(const Model& model,
                                                                         const std::vector<int>& inliers) const
{
  const RelativePose refined = refineRelativePose(model.pose, select(pairs_, inliers));
  return Model{ refined, refined.essential() };
}

}  // namespace view_servo
