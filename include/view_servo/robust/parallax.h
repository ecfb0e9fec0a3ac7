// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/robust/random.h"

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <vector>

namespace view_servo
{
/**
 * What matches away from a plane say of the epipolar geometry. Any F = [e]x H, with whatever epipole e, agrees with all
 * matches on the plane of H, so only the others can tell whether an F is right (Chum, Werner & Matas 2005: "Two-view
 * geometry estimation unaffected by a dominant plane").
 */
class Parallax
{
public:
  /**
   * @param plane homography, x_cur ~ H x_ref [px].
   * @param pairs matches of all kinds, the most trustworthy first: the fewer wrong ones are before the right ones, the
   * more the right ones mean.
   * @param threshold [px]: a pair agrees with an F when its Sampson distance is below this, and counts as on the plane
   * when its current point is nearer than twice this to where the plane's homography sends the reference point.
   */
  Parallax(const Eigen::Matrix3d& plane, const Correspondences& pairs, double threshold);

  /**
   * -log10 of the expected number of epipoles with which as many pairs off the plane agree, when the directions of
   * their parallax are random (a-contrario, as logSignificance()): at 0 one such epipole is expected by chance.
   */
  double significance(const Eigen::Matrix3d& f) const;

  /**
   * Draws `samples` matrices [e]x H, each with the epipole e of two pairs off the plane, and returns the most
   * significant one; empty when too few pairs lie off the plane.
   */
  std::optional<Eigen::Matrix3d> findFundamental(int samples, Rng& rng) const;

private:
  struct Pair
  {
    Correspondence pair;
    double chance;  ///< probability that a random direction of its parallax agrees with an epipole
  };

  /** How many of the first 25 pairs, of the first 50 and so on, and of all agree. */
  std::vector<std::size_t> countAgreeing(const Eigen::Matrix3d& f) const;
  double significance(const std::vector<std::size_t>& agreeing) const;

  Eigen::Matrix3d plane_;
  double threshold_;
  std::vector<Pair> off_plane_;
};

/** The homography of the plane on which most of the pairs lie, to within `tolerance` [px]; empty when none has four. */
std::optional<Eigen::Matrix3d> bestPlane(const Correspondences& pairs, double tolerance, Rng& rng);

/**
 * Parallax::significance() of a fundamental matrix off the plane on which most of those pairs lie that agree with it,
 * for the best of a few tolerances up to `threshold` [px]: where matches are exact, a small parallax tells as well.
 * @param pairs as for Parallax.
 */
double significanceOffBestPlane(const Eigen::Matrix3d& f, const Correspondences& pairs, double threshold, Rng& rng);

}  // namespace view_servo
