// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <optional>
#include <vector>

namespace view_servo
{
/** @file
 * Squares of grey values about a place of the stored view, (2 radius + 1)² of them row by row, and where they are in
 * another image. A homography h maps the stored view to that image, x_cur ~ h x_ref [px]; both may be one level of
 * their pyramids.
 */

/** Whether the square, seen through h, lies in an image of a size, with a pixel to spare. */
bool squareIsInside(const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius, const cv::Size& size);

/** Reads what h puts at the square into `values`, which has its size; squareIsInside() must hold. */
void warpSquare(const cv::Mat& current, const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius,
                std::vector<float>& values);

/**
 * Shifts and scales values to zero mean and unit norm, so that gain and offset of the light no longer matter.
 * @return the norm without the mean, before it was made 1; or 0, and nothing changes, when there is hardly any
 * contrast.
 */
float normalize(std::vector<float>& values);

/**
 * From the gradient of grey values to that of normalised ones: divides by the norm that normalize() returned, and takes
 * away the mean and the part along `values`, which are normalised already.
 */
void normalizeGradient(const std::vector<float>& values, float norm, std::vector<float>& gradient);

/** A square of one level of the stored view, normalised, with what its alignment needs. */
struct Patch
{
  bool usable = false;          ///< false: too near the border, of too little contrast, or an edge; the rest is not set
  int radius = 0;               ///< [px]
  Eigen::Matrix2d information;  ///< inverse covariance of its position [1/px²]
  std::vector<float> values;    ///< zero mean, unit norm
  std::vector<float> descent_u;  ///< components of the inverse Hessian times the gradient of `values`
  std::vector<float> descent_v;  ///< likewise for v
};

/** The patch about a place of an 8-bit grey image. */
Patch makePatch(const cv::Mat& image, const Eigen::Vector2d& at, int radius);

/** Where a patch was found. */
struct PatchAlignment
{
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  ///< what h shows at `at` is the stored view at `at + shift` [px]
  Eigen::Vector2d found;                            ///< where the patch's middle is in the current image [px]
  double correlation;  ///< of the patch with what was seen in its place before the last step, in [-1, 1]
};

/**
 * Looks for a usable patch near where h puts it, by the inverse compositional method (Baker & Matthews 2004) for a
 * shift.
 * @param at the patch's middle in its level of the stored view. @param iterations at most, >= 1.
 * @return empty when it leaves the image, loses all contrast or moves by more than 1.5 radii.
 */
std::optional<PatchAlignment> align(const Patch& patch, const Eigen::Vector2d& at, const cv::Mat& current,
                                    const Eigen::Matrix3d& h, int iterations);

}  // namespace view_servo
