// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "pair_geometry.h"

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/multi_hypothesis.h"
#include "view_servo/robust/parallax.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace view_servo
{
namespace
{
const Eigen::Matrix3d& matrixOf(const HomographyEstimator::Model& model)
{
  return model.h;
}

const Eigen::Matrix3d& matrixOf(const FundamentalEstimator::Model& model)
{
  return model;
}

template <typename Model>
std::optional<PairFit> toFit(const RansacResult<Model>& result, const std::vector<Association>& candidates,
                             RansacStatistics& statistics)
{
  statistics = result.statistics;
  if (!result.model)
  {
    return std::nullopt;
  }
  PairFit fit{ matrixOf(*result.model), {} };
  for (const int i : result.inliers)
  {
    fit.inliers.push_back(candidates[static_cast<std::size_t>(i)]);
  }
  return fit;
}

template <typename Model>
std::optional<PairFit> toFit(MultiHypothesisResult<Model>&& result, RansacStatistics& statistics)
{
  statistics = result.statistics;
  return result.model ? std::optional<PairFit>({ matrixOf(*result.model), std::move(result.matches) }) : std::nullopt;
}

}  // namespace

// --------------------------------------------------------------------------------------------------- what is common

double PairGeometry::chance(const cv::Size& current) const
{
  const double area = static_cast<double>(current.area());
  return std::min(1.0, agreeingArea(current) / area);
}

RansacParams PairGeometry::ransacParams() const
{
  RansacParams ransac_params = params_.ransac;
  ransac_params.inlier_threshold = threshold_;
  return ransac_params;
}

MultiHypothesisParams PairGeometry::hypothesisParams() const
{
  MultiHypothesisParams hypotheses = params_.hypotheses;
  hypotheses.sampling = params_.estimator == GeometryEstimator::IMPORTANCE ? HypothesisSampling::IMPORTANCE
                                                                           : HypothesisSampling::CANDIDATES;
  return hypotheses;
}

// ------------------------------------------------------------------------------------------------------- the models

namespace
{
/** Homography of a plane: x_cur ~ H x_ref; its error is the mean of the squared transfer errors in the two images. */
class PlanePair : public PairGeometry
{
public:
  PlanePair(const PointViewMatcherParams& params, double threshold) : PairGeometry(params, threshold)
  {
  }

  std::optional<PairFit> fitCandidates(const std::vector<Association>& candidates, const Correspondences& pairs,
                                       RansacStatistics& statistics, Rng& rng) const override
  {
    return toFit(ransac(HomographyEstimator(pairs), ransacParams(), rng), candidates, statistics);
  }

  std::optional<PairFit> fitAssociation(const AssociationMatrix& association, const Points& reference,
                                        const Points& current, RansacStatistics& statistics, Rng& rng) const override
  {
    return toFit(estimateHomography(association, reference, current, ransacParams(), hypothesisParams(), rng),
                 statistics);
  }

  Eigen::Matrix3d refine(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const override
  {
    return refineHomography(matrix, pairs, FIT_HUBER_WIDTH);
  }

  std::optional<Eigen::Matrix3d> settle(const Eigen::Matrix3d& matrix, const Correspondences& /*candidates*/,
                                        Rng& /*rng*/) const override
  {
    return matrix;
  }

  std::optional<Eigen::Matrix3d> mainPlane(const Eigen::Matrix3d& matrix, const Correspondences& /*agreeing*/,
                                           Rng& /*rng*/) const override
  {
    return matrix;
  }

  int sampleSize() const override
  {
    return HomographyEstimator::SAMPLE_SIZE;
  }

  double squaredError(const Eigen::Matrix3d& matrix, const Correspondence& pair) const override
  {
    return 0.5 * symmetricTransferError(matrix, matrix.inverse(), pair);
  }

  /** Candidates that agree, moved to where a corner's warped patch fits best, and corners that only patches find. */
  std::vector<CornerMatch> findAlong(const Eigen::Matrix3d& matrix, const LevelData& level) const override
  {
    // Candidates that agree, ...
    std::vector<std::optional<CornerMatch>> of_row(level.reference_corners.size());
    for (const CornerMatch& candidate : level.candidates)
    {
      if (agrees(matrix, level.correspondence(candidate)))
      {
        of_row[static_cast<std::size_t>(candidate.row)] = candidate;
      }
    }
    // ... with the more exact position of their patch where there is one, and what only the patches find.
    for (const GuidedMatch& match : searchAlongHomography(level.reference_image, level.reference_corners,
                                                          level.current_image, matrix, threshold(), params_.guidance))
    {
      std::optional<CornerMatch>& known = of_row[static_cast<std::size_t>(match.reference)];
      known = CornerMatch{ match.reference, match.current, known ? known->score : 0.0 };
    }
    std::vector<CornerMatch> matches;
    for (const std::optional<CornerMatch>& match : of_row)
    {
      if (match)
      {
        matches.push_back(*match);
      }
    }
    return matches;
  }

  Eigen::Matrix3d ofFullImages(const Eigen::Matrix3d& matrix, const Eigen::Matrix3d& reference_to_full,
                               const Eigen::Matrix3d& current_to_full) const override
  {
    return normalizedHomography(current_to_full * matrix * reference_to_full.inverse());
  }

  std::string name() const override
  {
    return "homography";
  }

private:
  double agreeingArea(const cv::Size& /*current*/) const override
  {
    return M_PI * threshold() * threshold();
  }
};

/** Epipolar geometry of a scene with depth: x_curᵀ F x_ref = 0; its error is the squared Sampson distance. */
class EpipolarPair : public PairGeometry
{
public:
  EpipolarPair(const PointViewMatcherParams& params, double threshold) : PairGeometry(params, threshold)
  {
  }

  std::optional<PairFit> fitCandidates(const std::vector<Association>& candidates, const Correspondences& pairs,
                                       RansacStatistics& statistics, Rng& rng) const override
  {
    return toFit(ransac(FundamentalEstimator(pairs, viewThreshold()), ransacParams(), rng), candidates, statistics);
  }

  std::optional<PairFit> fitAssociation(const AssociationMatrix& association, const Points& reference,
                                        const Points& current, RansacStatistics& statistics, Rng& rng) const override
  {
    return toFit(
        estimateFundamental(association, reference, current, ransacParams(), hypothesisParams(), rng, viewThreshold()),
        statistics);
  }

  Eigen::Matrix3d refine(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const override
  {
    return polishFundamental(matrix, pairs, FIT_HUBER_WIDTH);
  }

  /** It has to stand without the plane on which most of those lie that agree with it. */
  std::optional<Eigen::Matrix3d> settle(const Eigen::Matrix3d& matrix, const Correspondences& candidates,
                                        Rng& rng) const override
  {
    constexpr int SAMPLES = 1500;
    const auto stands = [&](const Eigen::Matrix3d& f) {
      return significanceOffBestPlane(f, candidates, threshold(), rng) >= params_.min_log_parallax;
    };
    if (stands(matrix))
    {
      return matrix;
    }
    const auto plane = bestPlane(agreeing(matrix, candidates), 2.0 * threshold(), rng);
    const auto other = plane ? Parallax(*plane, candidates, threshold()).findFundamental(SAMPLES, rng) : std::nullopt;
    if (!other)
    {
      return std::nullopt;
    }
    const Eigen::Matrix3d refined = refine(*other, agreeing(*other, candidates));
    return stands(refined) ? std::optional<Eigen::Matrix3d>(refined) : std::nullopt;
  }

  std::optional<Eigen::Matrix3d> mainPlane(const Eigen::Matrix3d& /*matrix*/, const Correspondences& agreeing,
                                           Rng& rng) const override
  {
    const auto plane = bestPlane(agreeing, threshold(), rng);
    if (!plane)
    {
      return std::nullopt;
    }
    const auto on_plane = std::count_if(agreeing.begin(), agreeing.end(), [&](const Correspondence& pair) {
      return (transfer(*plane, pair.reference) - pair.current).norm() <= threshold();
    });
    return 4 * static_cast<std::size_t>(on_plane) > agreeing.size() ? plane : std::nullopt;
  }

  int sampleSize() const override
  {
    return FundamentalEstimator::SAMPLE_SIZE;
  }

  double squaredError(const Eigen::Matrix3d& matrix, const Correspondence& pair) const override
  {
    return sampsonError(matrix, pair);
  }

  /** The best one-to-one matches of corners near each other's epipolar lines. */
  std::vector<CornerMatch> findAlong(const Eigen::Matrix3d& matrix, const LevelData& level) const override
  {
    std::vector<CornerMatch> matches;
    for (const Association& match : maximumWeightMatching(associateAlongFundamental(
             level.association, level.reference_corners, level.current_corners, matrix, threshold())))
    {
      matches.push_back(level.toMatch({ match.row, match.column, level.association.weight(match.row, match.column) }));
    }
    return matches;
  }

  Eigen::Matrix3d ofFullImages(const Eigen::Matrix3d& matrix, const Eigen::Matrix3d& reference_to_full,
                               const Eigen::Matrix3d& current_to_full) const override
  {
    return (current_to_full.inverse().transpose() * matrix * reference_to_full.inverse()).normalized();
  }

  std::string name() const override
  {
    return "fundamental matrix";
  }

private:
  double agreeingArea(const cv::Size& current) const override
  {
    const double diagonal = std::hypot(current.width, current.height);
    return 2.0 * threshold() * diagonal;
  }

  Correspondences agreeing(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const
  {
    Correspondences found;
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(found),
                 [&](const Correspondence& pair) { return agrees(matrix, pair); });
    return found;
  }

  /** Largest violation of the view constraint by a sample (thesis 6.3, method 2); 0: not tested. */
  double viewThreshold() const
  {
    return params_.view_consistency == ViewConsistency::WITHIN ? params_.consistency.threshold : 0.0;
  }
};

}  // namespace

std::unique_ptr<PairGeometry> makePairGeometry(GeometryModel model, const PointViewMatcherParams& params,
                                               double threshold)
{
  if (model == GeometryModel::HOMOGRAPHY)
  {
    return std::make_unique<PlanePair>(params, threshold);
  }
  return std::make_unique<EpipolarPair>(params, threshold);
}

}  // namespace view_servo
