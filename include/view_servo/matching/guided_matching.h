// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/matching/association.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <string>
#include <vector>

namespace view_servo
{
/** Options of the search for more matches that agree with a geometry. */
struct GuidedParams
{
  int patch_radius = 6;          ///< r: patches of (2 r + 1)² pixels are compared [px]
  double min_correlation = 0.6;  ///< least correlation of the current patch with the warped reference patch

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(GuidedParams& params);

/** A reference corner found again in the current image. */
struct GuidedMatch
{
  int reference = 0;                                  ///< index of the corner
  Eigen::Vector2d current = Eigen::Vector2d::Zero();  ///< sub-pixel position [px]
  double correlation = 0.0;                           ///< of the patches, in [min_correlation, 1]
};

/**
 * Looks for every reference corner near where a homography (reference -> current) sends it: the place, to a fraction of
 * a pixel, at which the reference patch, warped by the homography's affine approximation, has its largest zero-mean
 * normalised correlation with the current image. So a corner is found again whether or not the detector found it.
 * Left out are corners whose best place lies on the rim of the search region or correlates too little, whose reference
 * patch is flat, or that are sent nearer to the image's border than the radius and the patch need. The others come in
 * the order of `corners`.
 * @param reference, current 8-bit, one channel.
 * @param radius of the search region around the prediction, in each direction, rounded up to whole pixels >= 1 [px].
 */
std::vector<GuidedMatch> searchAlongHomography(const cv::Mat& reference, const std::vector<Corner>& corners,
                                               const cv::Mat& current, const Eigen::Matrix3d& h, double radius,
                                               const GuidedParams& params);

/**
 * Keeps those associations that agree with a fundamental matrix (x_curᵀ F x_ref = 0) to within `threshold`, a Sampson
 * distance [px]. An epipolar line restricts less than a point would, so the former weights still count: the new weight
 * is the fit, 0 to 1, plus the former weight as a fraction of the largest (thesis 9.6.3).
 */
AssociationMatrix associateAlongFundamental(const AssociationMatrix& association,
                                            const std::vector<Corner>& reference_corners,
                                            const std::vector<Corner>& current_corners, const Eigen::Matrix3d& f,
                                            double threshold);

}  // namespace view_servo
