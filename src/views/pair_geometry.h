// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/matching/association.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/point_view_matcher.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** A reference corner and where it is in the current image, in the pixels of their levels. */
struct CornerMatch
{
  int row;                  ///< index of the reference corner, which is its row in the association
  Eigen::Vector2d current;  ///< [px of the level]
  double score;             ///< weight of its association; 0: findAlong() found it without one
};

/** A geometry with the associations that agree with it. */
struct PairFit
{
  Eigen::Matrix3d matrix;            ///< of the model, reference -> current
  std::vector<Association> inliers;  ///< associations that agree with it, one-to-one
};

/** What is known of one level of each image, in the pixels of these levels; refers to it. */
struct LevelData
{
  const cv::Mat& reference_image;
  const cv::Mat& current_image;
  const std::vector<Corner>& reference_corners;  ///< rows of the association
  const std::vector<Corner>& current_corners;    ///< its columns
  const AssociationMatrix& association;
  const std::vector<CornerMatch>& candidates;

  Correspondence correspondence(const CornerMatch& match) const
  {
    return { reference_corners[static_cast<std::size_t>(match.row)].position, match.current };
  }
  CornerMatch toMatch(const Association& entry) const
  {
    return { entry.row, current_corners[static_cast<std::size_t>(entry.column)].position, entry.weight };
  }
};

/**
 * The geometry of an image pair as PointViewMatcher sees it: a 3x3 matrix, reference -> current, of one of the models.
 * Errors are squared, as in robust/.
 */
class PairGeometry
{
public:
  virtual ~PairGeometry() = default;

  /** Largest error of an inlier [px]. */
  double threshold() const
  {
    return threshold_;
  }

  /**
   * Robust fit to one-to-one candidates; empty when no sample gave a model.
   * @param pairs the points of each candidate, in the same order.
   */
  virtual std::optional<PairFit> fitCandidates(const std::vector<Association>& candidates, const Correspondences& pairs,
                                               RansacStatistics& statistics, Rng& rng) const = 0;

  /** Robust fit to all associations of two lists of points (thesis ch. 9); empty likewise. */
  virtual std::optional<PairFit> fitAssociation(const AssociationMatrix& association, const Points& reference,
                                                const Points& current, RansacStatistics& statistics,
                                                Rng& rng) const = 0;

  /** Least squares from `matrix`, robust against some outliers. */
  virtual Eigen::Matrix3d refine(const Eigen::Matrix3d& matrix, const Correspondences& pairs) const = 0;

  /**
   * The matrix, or one near it, that the candidates determine; empty when they leave it open, as those of one plane
   * leave a fundamental matrix. @param candidates all pairs, right and wrong, the most trustworthy first.
   */
  virtual std::optional<Eigen::Matrix3d> settle(const Eigen::Matrix3d& matrix, const Correspondences& candidates,
                                                Rng& rng) const = 0;

  /** The homography of a plane on which more than a quarter of what agrees lies; empty if there is none. */
  virtual std::optional<Eigen::Matrix3d> mainPlane(const Eigen::Matrix3d& matrix, const Correspondences& agreeing,
                                                   Rng& rng) const = 0;

  /** Number of pairs that a minimal sample has. */
  virtual int sampleSize() const = 0;

  /** Squared error of a pair under a matrix, as the model's estimator in robust/ has it [px²]. */
  virtual double squaredError(const Eigen::Matrix3d& matrix, const Correspondence& pair) const = 0;

  /** Whether the error of a pair is at most threshold(). */
  bool agrees(const Eigen::Matrix3d& matrix, const Correspondence& pair) const
  {
    return squaredError(matrix, pair) <= threshold_ * threshold_;
  }

  /** Probability that a match made by chance, anywhere in a current image of this size, agrees with a matrix. */
  double chance(const cv::Size& current) const;

  /** The matches, old and new, that are found where the matrix says that reference corners are. */
  virtual std::vector<CornerMatch> findAlong(const Eigen::Matrix3d& matrix, const LevelData& level) const = 0;

  /**
   * The matrix between two levels as one between the full images. The maps take pixels of a level to the full image.
   */
  virtual Eigen::Matrix3d ofFullImages(const Eigen::Matrix3d& matrix, const Eigen::Matrix3d& reference_to_full,
                                       const Eigen::Matrix3d& current_to_full) const = 0;

  /** Name of the model, for messages. */
  virtual std::string name() const = 0;

protected:
  PairGeometry(const PointViewMatcherParams& params, double threshold) : params_(params), threshold_(threshold)
  {
  }

  RansacParams ransacParams() const;
  MultiHypothesisParams hypothesisParams() const;

  const PointViewMatcherParams& params_;

private:
  /** Area of the current image within the threshold of where a matrix says that a reference point is [px²]. */
  virtual double agreeingArea(const cv::Size& current) const = 0;

  const double threshold_;
};

/** The geometry of a model. Keeps a reference to `params`. @param threshold largest error of an inlier [px]. */
std::unique_ptr<PairGeometry> makePairGeometry(GeometryModel model, const PointViewMatcherParams& params,
                                               double threshold);

}  // namespace view_servo
