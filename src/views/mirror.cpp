// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mirror.h"

#include "pair_geometry.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/significance.h"

#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <vector>

namespace view_servo
{
namespace
{
/** The features of an image turned left to right. @param width [px] */
PointFeatures mirrored(PointFeatures features, int width)
{
  for (Corner& corner : features.corners)
  {
    corner.position.x() = width - 1.0 - corner.position.x();
  }
  features.ends = profileEnds(features.corners, features.profiles);
  return features;
}

/** What the candidates of two lists of corners say. */
struct Evidence
{
  double significance = 0.0;            ///< -log10 of the false alarms of the better geometry, of either model
  std::vector<Eigen::Matrix3d> planes;  ///< the main plane of each, x_cur ~ H x_ref
};

/** @param size of the current image [px]. */
Evidence evidenceOf(const PointFeatures& reference, const ProfileIndex& index, const PointFeatures& current,
                    const cv::Size& size, const PointViewMatcherParams& params, Rng& rng)
{
  const std::vector<Association> candidates =
      candidateMatches(associatePoints(reference, index, current, params.points), params.points.assignment);
  Correspondences pairs;
  for (const Association& candidate : candidates)
  {
    pairs.push_back({ reference.corners[static_cast<std::size_t>(candidate.row)].position,
                      current.corners[static_cast<std::size_t>(candidate.column)].position });
  }
  Evidence evidence;
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    const std::unique_ptr<const PairGeometry> geometry =
        makePairGeometry(model, params, params.ransac.inlier_threshold);
    RansacStatistics statistics;
    const std::optional<PairFit> fit = geometry->fitCandidates(candidates, pairs, statistics, rng);
    Correspondences agreeing;
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(agreeing),
                 [&](const Correspondence& pair) { return fit && geometry->agrees(fit->matrix, pair); });
    if (!keepsOrientation(agreeing))
    {
      continue;
    }
    evidence.significance =
        std::max(evidence.significance,
                 logSignificance(pairs.size(), agreeing.size(), geometry->sampleSize(), geometry->chance(size)));
    if (const auto plane = geometry->mainPlane(fit->matrix, agreeing, rng))
    {
      evidence.planes.push_back(*plane);
    }
  }
  return evidence;
}

/** How many corners are found along that plane along which most are, fitted to them. */
std::size_t mostFound(const cv::Mat& reference, const std::vector<Corner>& corners, const cv::Mat& current,
                      const std::vector<Eigen::Matrix3d>& planes)
{
  constexpr int ROUNDS = 3;
  constexpr double RADIUS = 4.0;  // [px]
  constexpr std::size_t FEWEST = 8;
  GuidedParams guidance;
  guidance.min_correlation = 0.75;
  std::size_t most = 0;
  for (Eigen::Matrix3d plane : planes)
  {
    for (int round = 0; round < ROUNDS; ++round)
    {
      Correspondences found;
      for (const GuidedMatch& match : searchAlongHomography(reference, corners, current, plane, RADIUS, guidance))
      {
        found.push_back({ corners[static_cast<std::size_t>(match.reference)].position, match.current });
      }
      most = std::max(most, found.size());
      if (found.size() < FEWEST)
      {
        break;
      }
      plane = refineHomography(plane, found, FIT_HUBER_WIDTH);
    }
  }
  return most;
}

}  // namespace

bool isMirrored(const PreparedImage& reference, int reference_level, const PreparedImage& current, int current_level,
                std::vector<Eigen::Matrix3d> planes, double significance, Rng& rng)
{
  constexpr double SHARE = 0.3;    // of the profiles
  constexpr int ITERATIONS = 300;  // enough where a third of the candidates agrees
  PointViewMatcherParams params;
  params.points = current.params().points;
  params.points.search.share *= SHARE;
  params.ransac.max_iterations = ITERATIONS;
  const PointFeatures& from = reference.points(reference_level);
  const cv::Mat& image = current.image(current_level);
  const Evidence turned = evidenceOf(from, reference.profileIndex(reference_level),
                                     mirrored(current.points(current_level), image.cols), image.size(), params, rng);
  if (turned.significance <= params.min_log_significance)
  {
    return false;
  }
  if (planes.empty())
  {
    return turned.significance > significance;
  }
  const Eigen::Matrix3d to_level = current.toFull(current_level).inverse();
  for (Eigen::Matrix3d& plane : planes)
  {
    plane = to_level * plane * reference.toFull(reference_level);
  }
  cv::Mat turned_image;
  cv::flip(image, turned_image, 1);
  const cv::Mat& reference_image = reference.image(reference_level);
  return mostFound(reference_image, from.corners, turned_image, turned.planes) >
         mostFound(reference_image, from.corners, image, planes);
}

}  // namespace view_servo
