// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mirror.h"

#include "pair_geometry.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/significance.h"

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

/**
 * -log10 of the false alarms of the geometry, of either model, of two lists of corners; 0 when they have none.
 * @param size of the current image [px].
 */
double significanceOf(const PointFeatures& reference, const ProfileIndex& index, const PointFeatures& current,
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
  double most = 0.0;
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    const std::unique_ptr<const PairGeometry> geometry =
        makePairGeometry(model, params, params.ransac.inlier_threshold);
    RansacStatistics statistics;
    const std::optional<PairFit> fit = geometry->fitCandidates(candidates, pairs, statistics, rng);
    Correspondences agreeing;
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(agreeing),
                 [&](const Correspondence& pair) { return fit && geometry->agrees(fit->matrix, pair); });
    if (keepsOrientation(agreeing))
    {
      most = std::max(most,
                      logSignificance(pairs.size(), agreeing.size(), geometry->sampleSize(), geometry->chance(size)));
    }
  }
  return most;
}

}  // namespace

bool isMirrored(const PreparedImage& reference, int reference_level, const PreparedImage& current, int current_level,
                double significance, Rng& rng)
{
  constexpr double CLEARLY = 0.5;  // times the significance of what was found
  constexpr double SHARE = 0.3;    // of the profiles
  constexpr int ITERATIONS = 300;  // enough where a third of the candidates agrees
  PointViewMatcherParams params;
  params.points = current.params().points;
  params.points.search.share *= SHARE;
  params.ransac.max_iterations = ITERATIONS;
  const PointFeatures& from = reference.points(reference_level);
  const PointFeatures& to = current.points(current_level);
  const cv::Size size = current.image(current_level).size();
  const auto significance_with = [&](const PointFeatures& features) {
    return significanceOf(from, reference.profileIndex(reference_level), features, size, params, rng);
  };
  const double turned = significance_with(mirrored(to, size.width));
  return turned > std::max(params.min_log_significance, CLEARLY * significance) && turned > significance_with(to);
}

}  // namespace view_servo
