// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/motion.h"

#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/planar_motion_estimator.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/point_view_matcher.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace view_servo::check
{
namespace
{
constexpr double MAX_ERROR = 2.0;  // of an inlier [px]
constexpr int ENOUGH = 20;         // matches that agree

ViewMatch matchImages(const ImagePair& images, GeometryModel model)
{
  const PointViewMatcher matcher{ PointViewMatcherParams() };
  const PreparedImage before(images.before, cv::Rect(), matcher.params().points);
  const PreparedImage after(images.after, cv::Rect(), matcher.params().points);
  return matcher.match(before, after, model);
}

/** Why so many matches with such a median shift tell no motion; empty: they do. */
std::string faultOf(const SeenMotion& seen)
{
  constexpr double SMALLEST_SHIFT = 2.0;  // [px]
  if (seen.matches < ENOUGH)
  {
    return "the images before and after have only " + std::to_string(seen.matches) + " matches that agree";
  }
  return seen.shift < SMALLEST_SHIFT ? "the picture hardly changed, by " + number(seen.shift, 1) + " px" : "";
}

PlanarPose scaled(PlanarPose pose, double length)
{
  const double factor = pose.distance() > 0.0 ? length / pose.distance() : 0.0;
  pose.x *= factor;
  pose.y *= factor;
  return pose;
}

Eigen::Vector3d unitOrZero(const Eigen::Vector3d& vector)
{
  return vector.isZero() ? vector : Eigen::Vector3d(vector.normalized());
}

/** How far two motions are apart: the angle between their directions, and that between their rotations [rad]. */
double difference(const Motion& a, const Motion& b)
{
  const Eigen::Vector3d direction_a = unitOrZero(a.translation);
  const Eigen::Vector3d direction_b = unitOrZero(b.translation);
  return std::atan2(direction_a.cross(direction_b).norm(), direction_a.dot(direction_b)) +
         (a.rotation - b.rotation).norm();
}

/**
 * Where a camera turned and did not move, noise alone makes the plane and the translation that its homography is
 * decomposed into, and they may be impossible ones. @return none when a turn does not explain the pairs.
 */
std::optional<Motion> turnAlone(const Eigen::Matrix3d& h, const Correspondences& pairs, double focal_length)
{
  Points before;
  std::transform(pairs.begin(), pairs.end(), std::back_inserter(before),
                 [](const Correspondence& pair) { return pair.reference; });
  const Eigen::Matrix3d turn = nearestRotation(calibratedHomography(h, Eigen::Matrix3d::Identity(), before));
  std::vector<double> errors;
  for (const Correspondence& pair : pairs)
  {
    errors.push_back(focal_length * ((turn * pair.reference.homogeneous()).hnormalized() - pair.current).norm());
  }
  if (medianOf(std::move(errors)) > MAX_ERROR)
  {
    return std::nullopt;
  }
  const Eigen::AngleAxisd rotation(Eigen::Matrix3d(turn.transpose()));  // of the camera; the points turn the other way
  return Motion{ Eigen::Vector3d::Zero(), rotation.angle() * rotation.axis() };
}

}  // namespace

Motion toMotion(const Eigen::Isometry3d& after_in_before)
{
  const Eigen::AngleAxisd rotation(after_in_before.linear());
  return { after_in_before.translation(), rotation.angle() * rotation.axis() };
}

Motion toMotion(const PlanarPose& after_in_before)
{
  return { { after_in_before.x, after_in_before.y, 0.0 }, { 0.0, 0.0, after_in_before.yaw } };
}

SeenMotion seenByBase(const ImagePair& images, const CameraMount& mount, const PlanarPose& measured)
{
  constexpr double MAX_YAW = 1.0;  // [rad]
  // Candidates are wanted, of whatever geometry: that of a motion on the floor is sought among them.
  const ViewMatch match = matchImages(images, GeometryModel::FUNDAMENTAL);
  Correspondences pairs;
  std::vector<double> shifts;
  for (const MatchedPoint& point : match.matches)
  {
    const Eigen::Vector2d before = mount.level(images.camera.normalized(point.position.reference));
    const Eigen::Vector2d after = mount.level(images.camera.normalized(point.position.current));
    if (before.allFinite() && after.allFinite())
    {
      pairs.push_back({ before, after });
      shifts.push_back((point.position.current - point.position.reference).norm());
    }
  }
  RansacParams params;
  params.inlier_threshold = MAX_ERROR / images.camera.k(0, 0);
  params.sampling = Sampling::UNIFORM;
  Rng rng(1);
  const auto found = ransac(PlanarMotionEstimator(pairs, MAX_YAW), params, rng);
  SeenMotion seen;
  seen.matches = static_cast<int>(found.inliers.size());
  std::vector<double> agreeing;
  for (const int i : found.inliers)
  {
    agreeing.push_back(shifts[static_cast<std::size_t>(i)]);
  }
  seen.shift = agreeing.empty() ? 0.0 : medianOf(std::move(agreeing));
  seen.fault = faultOf(seen);
  if (!found.model || !seen.fault.empty())
  {
    return seen;
  }
  const double length = mount.ofCamera(measured).distance();
  const PlanarPose base = mount.ofBase(scaled(inverse(found.model->pose), length));
  Motion motion = toMotion(base);
  motion.translation = unitOrZero(motion.translation);
  seen.motion = motion;
  return seen;
}

SeenMotion seenByHand(const ImagePair& images, const Motion& measured)
{
  const ViewMatch match = matchImages(images, GeometryModel::HOMOGRAPHY);
  SeenMotion seen;
  Correspondences pairs;
  Points before;
  std::vector<double> shifts;
  for (const MatchedPoint& point : match.matches)
  {
    const Correspondence pair{ images.camera.normalized(point.position.reference),
                               images.camera.normalized(point.position.current) };
    if (point.inlier && pair.reference.allFinite() && pair.current.allFinite())
    {
      pairs.push_back(pair);
      before.push_back(pair.reference);
      shifts.push_back((point.position.current - point.position.reference).norm());
    }
  }
  seen.matches = static_cast<int>(pairs.size());
  seen.shift = shifts.empty() ? 0.0 : medianOf(std::move(shifts));
  seen.fault = faultOf(seen);
  const std::optional<Eigen::Matrix3d> h = seen.fault.empty() ? homographyFromPoints(pairs) : std::nullopt;
  if (!h)
  {
    return seen;
  }
  double least = std::numeric_limits<double>::infinity();
  for (const EuclideanHomography& candidate : decomposeHomography(*h, Eigen::Matrix3d::Identity(), before))
  {
    // It maps points of the camera before to the camera after; the motion is the inverse.
    Eigen::Isometry3d after_from_before = Eigen::Isometry3d::Identity();
    after_from_before.linear() = candidate.rotation;
    after_from_before.translation() = candidate.translation_over_distance;
    Motion motion = toMotion(after_from_before.inverse());
    motion.translation = unitOrZero(motion.translation);
    if (difference(motion, measured) < least)
    {
      least = difference(motion, measured);
      seen.motion = motion;
    }
  }
  if (!seen.motion)
  {
    seen.motion = turnAlone(*h, pairs, images.camera.k(0, 0));
  }
  seen.fault = seen.motion ? "" : "the homography between the images before and after is not that of a plane";
  return seen;
}

}  // namespace view_servo::check
