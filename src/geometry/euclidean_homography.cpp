// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/euclidean_homography.h"

#include "decompositions.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace view_servo
{
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& matrix)
{
  const Svd3 svd = singularValues(matrix);
  Eigen::Matrix3d signs = Eigen::Matrix3d::Identity();
  signs(2, 2) = (svd.u * svd.v.transpose()).determinant();
  return svd.u * signs * svd.v.transpose();
}

Eigen::Matrix3d calibratedHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k, const Points& seen)
{
  Eigen::Matrix3d result = k.inverse() * h * k;
  result /= singularValues(result).values(1);
  int ahead = 0;
  for (const Eigen::Vector2d& point : seen)
  {
    const Eigen::Vector3d x = k.inverse() * point.homogeneous();
    ahead += (result * x).z() > 0.0 ? 1 : -1;
  }
  return ahead >= 0 ? result : Eigen::Matrix3d(-result);
}

EuclideanHomography motionBefore(const Eigen::Matrix3d& calibrated, const Eigen::Vector3d& normal)
{
  const Eigen::Matrix3d along = calibrated * (Eigen::Matrix3d::Identity() - normal * normal.transpose());
  const Eigen::Matrix3d rotation = nearestRotation(along);  // of two directions; the third follows from them
  return { rotation, (calibrated - rotation) * normal, normal };
}

EuclideanHomography movedOn(const EuclideanHomography& homography, const Eigen::Isometry3d& motion, double distance)
{
  return { motion.linear() * homography.rotation,
           motion.linear() * homography.translation_over_distance + motion.translation() / distance,
           homography.normal };
}

std::vector<EuclideanHomography> decomposeHomography(const Eigen::Matrix3d& h, const Eigen::Matrix3d& k,
                                                     const Points& seen)
{
  constexpr double ONLY_TURNED = 1e-6;  // of the singular values, which are 1 then
  std::vector<EuclideanHomography> result;
  if (!h.allFinite() || seen.empty() || !(std::abs(h.determinant()) > 0.0))
  {
    return result;
  }
  const Eigen::Matrix3d normalized = calibratedHomography(h, k, seen);
  if (!normalized.allFinite() || !(normalized.determinant() > 0.0))
  {
    return result;  // seen from behind
  }
  const Svd3 svd = singularValues(normalized);
  if (svd.values(0) - svd.values(2) < ONLY_TURNED)
  {
    result.push_back({ svd.u * svd.v.transpose(), Eigen::Vector3d::Zero(),
                       Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()) });
    return result;
  }
  cv::Mat matrix;
  cv::eigen2cv(normalized, matrix);
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  std::vector<cv::Mat> normals;
  cv::decomposeHomographyMat(matrix, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
  for (std::size_t i = 0; i < rotations.size(); ++i)
  {
    EuclideanHomography solution;
    cv::cv2eigen(rotations[i], solution.rotation);
    cv::cv2eigen(translations[i], solution.translation_over_distance);
    cv::cv2eigen(normals[i], solution.normal);
    const bool in_front = std::all_of(seen.begin(), seen.end(), [&](const Eigen::Vector2d& point) {
      const Eigen::Vector3d x = k.inverse() * point.homogeneous();
      return solution.normal.dot(x) > 0.0 && (solution.matrix() * x).z() > 0.0;
    });
    if (in_front)
    {
      result.push_back(solution);
    }
  }
  return result;
}

}  // namespace view_servo
