// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/line_homography.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Planes on which matched line segments lie, and the fundamental matrix of such a scene (thesis 4.7).
 */

/** Options of the search for planes. */
struct LinePlaneParams
{
  double threshold = 2.0;  ///< largest distance of a plane's lines, across, RMS of the two images [px]
  int min_lines = 8;       ///< least number of lines that make a plane
  int max_planes = 4;      ///< at most this many planes are looked for

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LinePlaneParams& params);

/** The planes found, as homographies x_cur ~ H x_ref [px], and which of them each line is on. */
struct LinePlanes
{
  std::vector<Eigen::Matrix3d> homographies;  ///< in the order in which they were found: the largest first, as a rule
  std::vector<int> of_line;                   ///< index into `homographies` for each line; -1: on no plane
};

/**
 * One plane after the other, each by RANSAC among the lines that lie on none of those before (thesis 4.7.1).
 * @param ransac_params for each plane; its threshold and sampling are replaced, and at most 500 iterations are made.
 */
LinePlanes findPlanes(const SegmentPairs& lines, const LinePlaneParams& params, const RansacParams& ransac_params,
                      Rng& rng);

/**
 * Whether the transfer error of a pair of points, RMS of the two images, is at most `threshold` [px] for some plane.
 */
bool liesOnPlane(const LinePlanes& planes, const Correspondence& point, double threshold);

/**
 * Fundamental matrix (x_curᵀ F x_ref = 0, pixels) by RANSAC from points, such as intersections of matched lines. Empty
 * when there are fewer than twelve points, or when no matrix agrees with at least twelve. Samples are uniform, whatever
 * params.sampling says. Where nearly all points lie on one plane, a matrix with any epipole agrees with them: Parallax
 * tells that.
 */
std::optional<Eigen::Matrix3d> fundamentalOfPoints(const Correspondences& points, const RansacParams& params, Rng& rng);

/**
 * Fundamental matrix from the first two planes (thesis 4.7): the fit to the end points of their lines, each paired with
 * the point to which its plane's homography maps it. Empty when there are fewer than two planes, or they leave F
 * undetermined.
 */
std::optional<Eigen::Matrix3d> fundamentalOfPlanes(const SegmentPairs& lines, const LinePlanes& planes);

}  // namespace view_servo
