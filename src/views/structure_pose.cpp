// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/structure_pose.h"

#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/planar_pose.h"

#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
constexpr std::size_t FEWEST = 12;
constexpr double THRESHOLD = 3.0;  // of a point that agrees [px]
constexpr double NOISE = 0.5;      // least standard deviation of a match [px]
// As in sceneMotion(): so many of the matches err independently of each other.
constexpr double INDEPENDENT = 9.0;

/** Points of the view's optical frame [m], and where the current camera sees them, on z = 1 of its optical frame. */
struct KnownPoints
{
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> seen;
};

/** The point of the structure next to a pixel of the view; null: none is near. */
const StructurePoint* nearest(const ViewStructure& structure, const Eigen::Vector2d& pixel)
{
  constexpr double FARTHEST = 3.0;  // a corner is found within it again [px]
  const StructurePoint* best = nullptr;
  double least = FARTHEST;
  for (const StructurePoint& point : structure.points)
  {
    const double distance = (point.pixel - pixel).norm();
    if (distance < least)
    {
      least = distance;
      best = &point;
    }
  }
  return best;
}

KnownPoints knownPoints(const ViewMatch& match, const Camera& camera, const Eigen::Vector3d& level_axis,
                        const ViewStructure& structure, const Camera& current)
{
  constexpr double WORST = 0.2;  // standard deviation of an inverse depth by itself
  const double pixel = 1.0 / camera.k(0, 0);
  KnownPoints known;
  for (const MatchedPoint& candidate : match.matches)
  {
    const StructurePoint* point = candidate.inlier ? nearest(structure, candidate.position.reference) : nullptr;
    if (point == nullptr || NOISE * pixel > WORST * point->inverse_depth * std::sqrt(point->information))
    {
      continue;
    }
    const Eigen::Vector3d ray = camera.normalized(candidate.position.reference).homogeneous();
    const Eigen::Vector2d seen = current.normalized(candidate.position.current);
    const double forward = level_axis.dot(ray);
    if (!(forward > 0.0) || !seen.allFinite())
    {
      continue;
    }
    const Eigen::Vector3d at = ray / (forward * point->inverse_depth);
    known.points.emplace_back(at.x(), at.y(), at.z());
    known.seen.emplace_back(seen.x(), seen.y());
  }
  return known;
}

/** Turns the rotation and translation of X_cur = R X_view + t into the pose, and says how exact it is. */
StructurePose withCovariance(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                             const KnownPoints& known, const std::vector<int>& inliers, double pixel)
{
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  Matrix6d information = Matrix6d::Zero();
  double squares = 0.0;
  for (const int i : inliers)
  {
    const auto index = static_cast<std::size_t>(i);
    const cv::Point3d& point = known.points[index];
    const Eigen::Vector3d turned = rotation * Eigen::Vector3d(point.x, point.y, point.z);
    const Eigen::Vector3d at = turned + translation;
    const Eigen::Vector2d seen = at.hnormalized();
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << 1.0, 0.0, -seen.x(), 0.0, 1.0, -seen.y();
    by_point /= at.z();
    Eigen::Matrix<double, 2, 6> by_motion;  // by small rotations R' = exp(w) R and translations
    by_motion << -by_point * crossMatrix(turned), by_point;
    information += by_motion.transpose() * by_motion;
    squares += (seen - Eigen::Vector2d(known.seen[index].x, known.seen[index].y)).squaredNorm();
  }
  const double count = static_cast<double>(inliers.size());
  const double variance = std::max(squares / (2.0 * count), NOISE * NOISE * pixel * pixel);
  const Matrix6d of_motion = information.inverse() * (variance * std::max(1.0, count / INDEPENDENT));

  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = rotation;
  motion.translation() = translation;
  return { cameraPoseAfter(motion, of_motion), inliers.size() };
}

}  // namespace

std::optional<StructurePose> structurePose(const ViewMatch& match, const StoredView& view,
                                           const ViewStructure& structure, const Camera& current)
{
  if (match.outcome != MatchOutcome::MATCHED || !view.camera || !view.pose || !view.camera->fault().empty())
  {
    return std::nullopt;
  }
  Eigen::Vector3d level_axis;
  try
  {
    const CameraMount mount(Eigen::Isometry3d(view.pose->orientation));
    level_axis = mount.level_from_camera.row(2);
  }
  catch (const std::invalid_argument&)
  {
    return std::nullopt;  // it looks up or down: depths are not those of a base's level camera
  }
  const KnownPoints known = knownPoints(match, *view.camera, level_axis, structure, current);
  if (known.points.size() < FEWEST)
  {
    return std::nullopt;
  }
  constexpr int SAMPLES = 500;
  constexpr double CONFIDENCE = 0.999;
  const double pixel = 2.0 / (current.k(0, 0) + current.k(1, 1));
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat turn;
  cv::Mat shift;
  std::vector<int> inliers;
  if (!cv::solvePnPRansac(known.points, known.seen, identity, cv::noArray(), turn, shift, false, SAMPLES,
                          static_cast<float>(THRESHOLD * pixel), CONFIDENCE, inliers, cv::SOLVEPNP_EPNP) ||
      inliers.size() < FEWEST || 2 * inliers.size() < known.points.size())
  {
    return std::nullopt;
  }
  KnownPoints agreeing;
  for (const int i : inliers)
  {
    agreeing.points.push_back(known.points[static_cast<std::size_t>(i)]);
    agreeing.seen.push_back(known.seen[static_cast<std::size_t>(i)]);
  }
  cv::solvePnPRefineLM(agreeing.points, agreeing.seen, identity, cv::noArray(), turn, shift);
  cv::Mat rotation_matrix;
  cv::Rodrigues(turn, rotation_matrix);
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  cv::cv2eigen(rotation_matrix, rotation);
  cv::cv2eigen(shift, translation);
  StructurePose pose = withCovariance(rotation, translation, known, inliers, pixel);
  if (!pose.view_from_current.matrix().allFinite() || !pose.covariance.allFinite())
  {
    return std::nullopt;
  }
  return pose;
}

}  // namespace view_servo
