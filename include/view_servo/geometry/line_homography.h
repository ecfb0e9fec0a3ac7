// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace view_servo
{
/** @file
 * Plane homographies and line segments. H maps points of the reference image to the current one, `x_cur ~ H x_ref`, and
 * lines the other way, `l_ref ~ Hᵀ l_cur`. The line of a segment is measured well but its end points are not, so errors
 * are distances across the segment.
 */

/**
 * The same physical line seen in the two views; the segments have the same sense but may show different parts of it.
 */
struct SegmentPair
{
  Segment reference;
  Segment current;
};

using SegmentPairs = std::vector<SegmentPair>;

/**
 * Homography of n >= 4 lines (thesis 2.5), by linear least squares with isotropic normalisation: minimises the squared
 * distances of the mapped reference end points from the current lines, each multiplied by the point's third coordinate.
 * H is scaled to third coordinate 1 at the mean of the reference segments' midpoints. Empty when the lines do not
 * determine it (four parallel, or concurrent).
 */
std::optional<Eigen::Matrix3d> homographyFromLines(const SegmentPairs& pairs);

/** The same for an affine map: n >= 3 lines. */
std::optional<Eigen::Matrix3d> affinityFromLines(const SegmentPairs& pairs);

/** How much a local affine map may distort; s1 >= s2 are the singular values of its linear part. */
struct AffinityLimits
{
  /** Largest factor by which lengths grow or shrink, on average over all directions: sqrt(s1 s2), > 1. */
  double scale_change = 5.0;
  double anisotropy = 6.0;  ///< largest (s1² + s2²) / (s1 s2): about s1 / s2 when the two differ much, > 2
};

/**
 * Weighted least-squares affine map, of third row (0, 0, 1), of n >= 3 points: intersections of lines, or end points of
 * segments.
 * @param from, to, weights arrays of n [px]. @return x_to = A x_from; empty when the points `from` are nearly
 * collinear, or when the map mirrors or distorts more than the limits allow.
 */
std::optional<Eigen::Matrix3d> plausibleAffinity(const Eigen::Vector2d* from, const Eigen::Vector2d* to,
                                                 const double* weights, int n, const AffinityLimits& limits);

/** The segment mapped by H; empty when an end point maps near or beyond infinity (third coordinate < 0.1). */
std::optional<Segment> transfer(const Eigen::Matrix3d& h, const Segment& segment);

/** How two segments in one image lie relative to each other. */
struct SegmentAgreement
{
  double distance;  ///< largest distance between them, across, where they lie side by side [px]
  double cosine;    ///< cosine of the angle between their directions, in [-1, 1]
  double overlap;   ///< length of the part side by side, over the length of the shorter segment, in [0, 1]
  double share;     ///< length of the part side by side, over the length that the two cover together, in [0, 1]
};

/** Compares two segments; the distance is infinite when no parts of them lie side by side. */
SegmentAgreement compare(const Segment& a, const Segment& b);

}  // namespace view_servo
