// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "pair_geometry.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/multi_hypothesis.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double HUBER_WIDTH = 0.5;  // of the final fits: residuals beyond count linearly [px]

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

std::unique_ptr<PairGeometry> makePairGeometry(GeometryModel model, const PointViewMatcherParams& params,
                                               double threshold)
{
  if (model == GeometryModel::HOMOGRAPHY)
  {
    return std::make_unique<PlanePair>(params, threshold);
  }
  return std::make_unique<EpipolarPair>(params, threshold);
}

// -------------------------------------------------------------------------------------------------------- homography

std::optional<PairFit> PlanePair::fitCandidates(const std::vector<Association>& candidates,
                                                const Correspondences& pairs, RansacStatistics& statistics,
                                                Rng& rng) const
{
  return toFit(ransac(HomographyEstimator(pairs), ransacParams(), rng), candidates, statistics);
}

std::optional<PairFit> PlanePair::fitAssociation(const AssociationMatrix& association, const Points& reference,
                                                 const Points& current, RansacStatistics& statistics, Rng& rng) const
{
  return toFit(estimateHomography(association, reference, current, ransacParams(), hypothesisParams(), rng),
               statistics);
}

Eigen::Matrix3d PlanePair::refine(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const
{
  return refineHomography(matrix, pairs, HUBER_WIDTH);
}

int PlanePair::sampleSize() const
{
  return HomographyEstimator::SAMPLE_SIZE;
}

double PlanePair::squaredError(const Eigen::Matrix3d& matrix, const Correspondence& pair) const
{
  return 0.5 * symmetricTransferError(matrix, matrix.inverse(), pair);
}

std::vector<CornerMatch> PlanePair::findAlong(const Eigen::Matrix3d& matrix, const LevelData& level) const
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

Eigen::Matrix3d PlanePair::ofFullImages(const Eigen::Matrix3d& matrix, const Eigen::Matrix3d& reference_to_full,
                                        const Eigen::Matrix3d& current_to_full) const
{
  return normalizedHomography(current_to_full * matrix * reference_to_full.inverse());
}

std::string PlanePair::name() const
{
  return "homography";
}

double PlanePair::agreeingArea(const cv::Size& /*current*/) const
{
  return M_PI * threshold() * threshold();
}

// ------------------------------------------------------------------------------------------------ fundamental matrix

std::optional<PairFit> EpipolarPair::fitCandidates(const std::vector<Association>& candidates,
                                                   const Correspondences& pairs, RansacStatistics& statistics,
                                                   Rng& rng) const
{
  return toFit(ransac(FundamentalEstimator(pairs, viewThreshold()), ransacParams(), rng), candidates, statistics);
}

std::optional<PairFit> EpipolarPair::fitAssociation(const AssociationMatrix& association, const Points& reference,
                                                    const Points& current, RansacStatistics& statistics, Rng& rng) const
{
  return toFit(
      estimateFundamental(association, reference, current, ransacParams(), hypothesisParams(), rng, viewThreshold()),
      statistics);
}

Eigen::Matrix3d EpipolarPair::refine(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const
{
  return polishFundamental(matrix, pairs, HUBER_WIDTH);
}

int EpipolarPair::sampleSize() const
{
  return FundamentalEstimator::SAMPLE_SIZE;
}

double EpipolarPair::squaredError(const Eigen::Matrix3d& matrix, const Correspondence& pair) const
{
  return sampsonError(matrix, pair);
}

std::vector<CornerMatch> EpipolarPair::findAlong(const Eigen::Matrix3d& matrix, const LevelData& level) const
{
  std::vector<CornerMatch> matches;
  for (const Association& match : maximumWeightMatching(associateAlongFundamental(
           level.association, level.reference_corners, level.current_corners, matrix, threshold())))
  {
    matches.push_back(level.toMatch({ match.row, match.column, level.association.weight(match.row, match.column) }));
  }
  return matches;
}

Eigen::Matrix3d EpipolarPair::ofFullImages(const Eigen::Matrix3d& matrix, const Eigen::Matrix3d& reference_to_full,
                                           const Eigen::Matrix3d& current_to_full) const
{
  return (current_to_full.inverse().transpose() * matrix * reference_to_full.inverse()).normalized();
}

std::string EpipolarPair::name() const
{
  return "fundamental matrix";
}

double EpipolarPair::agreeingArea(const cv::Size& current) const
{
  const double diagonal = std::hypot(current.width, current.height);
  return 2.0 * threshold() * diagonal;
}

double EpipolarPair::viewThreshold() const
{
  return params_.view_consistency == ViewConsistency::WITHIN ? params_.consistency.threshold : 0.0;
}

}  // namespace view_servo
