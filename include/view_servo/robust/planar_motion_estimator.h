// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_motion.h"

#include <cstddef>
#include <optional>
#include <vector>

namespace view_servo
{
/** A motion on the floor, with the matrices by which every datum is scored. */
struct PlanarMotion
{
  PlanarPose pose;              ///< pose of the reference camera in the current one, scaled to distance 1
  Eigen::Matrix3d rotation;     ///< R of X_cur = R X_ref + t
  Eigen::Vector3d translation;  ///< t of the same equation, of length 1
  Eigen::Matrix3d essential;    ///< x_curᵀ E x_ref = 0

  explicit PlanarMotion(const PlanarPose& reference_in_current)
    : pose(reference_in_current),
      rotation(levelRotation(reference_in_current.yaw)),
      translation(levelTranslation(reference_in_current)),
      essential(essentialMatrix(reference_in_current))
  {
  }
};

/**
 * Motion on the floor between two level cameras, from two correspondences of level points (see CameraMount), for
 * ransac(). Error = squared Sampson distance, infinite for points that would lie behind a camera. Errors, and with them
 * the inlier threshold, are in units of the level points.
 */
class PlanarMotionEstimator
{
public:
  using Model = PlanarMotion;
  static constexpr int SAMPLE_SIZE = 2;

  /**
   * Keeps a reference to `pairs`, which must outlive the estimator.
   * @param max_yaw motions with a larger |yaw| are dropped [rad].
   */
  PlanarMotionEstimator(const Correspondences& pairs, double max_yaw) : pairs_(pairs), max_yaw_(max_yaw)
  {
  }

  std::size_t size() const
  {
    return pairs_.size();
  }
  bool accepts(const std::vector<int>& sample) const;
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const Correspondences& pairs_;
  double max_yaw_;
};

/**
 * Pose on the floor of the reference camera in the current one, from two sightings of landmarks, for ransac().
 * Error = squared distance in the current image, in units of the level points; infinite behind the camera.
 */
class PlanarPoseEstimator
{
public:
  using Model = PlanarPose;
  static constexpr int SAMPLE_SIZE = 2;

  /** Keeps a reference to `sightings`, which must outlive the estimator. @param width inlier threshold, in units
   * of the level points. */
  PlanarPoseEstimator(const std::vector<Sighting>& sightings, double width) : sightings_(sightings), width_(width)
  {
  }

  std::size_t size() const
  {
    return sightings_.size();
  }
  bool accepts(const std::vector<int>& sample) const;
  void solve(const std::vector<int>& sample, std::vector<Model>& models) const;
  double error(const Model& model, std::size_t i) const;
  std::optional<Model> refit(const Model& model, const std::vector<int>& inliers) const;

private:
  const std::vector<Sighting>& sightings_;
  double width_;
};

}  // namespace view_servo
