// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of HomographyAligner. */
struct HomographyAlignerParams
{
  int max_points = 200;          ///< most corners of the stored view that are looked for in an image
  int patch_radius = 10;         ///< patches of (2 r + 1)² pixels are compared; on coarse levels smaller ones
  int levels = 4;                ///< number of levels of the image pyramids, the image itself included, >= 1
  double min_correlation = 0.7;  ///< least correlation of a patch that counts as found again
  double max_residual = 2.0;  ///< largest distance between where a supporting point is found and where H sends it [px]
  int min_supporting = 15;    ///< least number of points that support a homography
  double min_support = 0.25;  ///< least part of the points in sight that has to support the homography
  bool refine = true;         ///< whether all pixels of the region refine the result

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(HomographyAlignerParams& params);

/** The homography of an image, when there is one. */
struct TrackedHomography
{
  bool found = false;  ///< whether enough points support a homography
  Eigen::Matrix3d h = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());  ///< x_cur ~ H x_ref [px]
  int looked_for = 0;                                     ///< points predicted to be in the image
  int supporting = 0;                                     ///< of these, found where the homography sends them
  Points points;                                          ///< the supporting ones, in the stored view [px]
  double rms = std::numeric_limits<double>::quiet_NaN();  ///< root mean square of the supporting points' residuals [px]
};

/**
 * Finds the homography of a planar scene from one image to the next (thesis 8.3, 8.4), always against the stored view,
 * so that nothing drifts. The patch of every corner is looked for where a predicted homography sends it, and aligned
 * with the image by the inverse compositional method (Baker & Matthews 2004), from coarse to fine levels. Both are
 * normalised to zero mean and unit norm, so that gain and offset of the light do not matter. As in the thesis no point
 * is followed from image to image: each is found anew or not. RANSAC on the coarsest level decides which points are
 * believed, and on finer levels robust fits do, which weigh each patch by the information of its texture. Hidden
 * patches correlate too little and drop out. In the end all pixels of the region refine the homography, in blocks, of
 * which those that differ more than the others count less.
 *
 * It keeps nothing from image to image; the caller predicts, from odometry or from the motion before.
 */
class HomographyAligner
{
public:
  /**
   * @param reference 8-bit, one channel. @param region of it that shows the plane [px]; empty = everywhere.
   * @throws std::invalid_argument with all faults of the parameters, or when the image has the wrong type, the region
   * leaves it, or it has too few corners.
   */
  HomographyAligner(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params);

  /**
   * @param current 8-bit, one channel, of any size.
   * @param predicted where the homography is expected (x_cur ~ H x_ref).
   * @throws std::invalid_argument when the image has the wrong type.
   */
  TrackedHomography track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const;

  /** The corners of the stored view that are looked for [px], strongest first. */
  const Points& points() const;

private:
  class Impl;

  std::shared_ptr<const Impl> impl_;  // copies share it: it does not change
};

}  // namespace view_servo
