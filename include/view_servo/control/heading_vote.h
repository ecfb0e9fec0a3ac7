// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/parameters/parameter.h"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/**
 * Matched points, each with the weight that the matcher gives it. They are level points (planar_motion.h), except
 * between the matcher's message and Homing::addMatches(), where they are pixels of the raw images.
 */
struct HeadingEvidence
{
  Correspondences pairs;
  std::vector<double> weights;  ///< one for each pair, >= 0: how much the matcher trusts it
};

/** Options of the heading vote. */
struct HeadingVoteParams
{
  int bins = 181;           ///< number of bins of the histogram of headings
  double margin = 0.17;     ///< K: headings closer than this to +-pi/2 are too uncertain to be chosen [rad]
  double smoothing = 0.02;  ///< standard deviation of the Gaussian over which a vote is spread [rad]
  double narrowing = 0.7;   ///< factor by which the region becomes narrower when the highest peak of all lies inside it
  double widening = 1.3;    ///< factor by which the region becomes wider when the highest peak of all lies outside it
  double min_half_width = 0.1;  ///< least half width of the region [rad]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(HeadingVoteParams& params);

/**
 * Votes for the direction to the stored view (thesis 5.2). Each match gives the line through its reference and its
 * current position, both seen with the reference's orientation; where it meets the horizon is a candidate epipole. The
 * histogram runs over headings in the current camera, from -pi/2 (right) to pi/2 (left). It does not tell whether the
 * view lies ahead or behind.
 */
class HeadingHistogram
{
public:
  HeadingHistogram() = default;
  /**
   * @param evidence matches as level points. @param yaw of the reference camera in the current one [rad]; 0 in the
   * thesis, which forbids rotation.
   */
  HeadingHistogram(const HeadingEvidence& evidence, double yaw, const HeadingVoteParams& params);

  /** The votes of each bin, from right to left. */
  const std::vector<double>& votes() const
  {
    return votes_;
  }
  /** The votes over headings in a frame in which the camera is turned by `yaw`, as on a base [rad]. */
  std::vector<double> votesFor(double yaw) const;
  /** Heading of a bin's middle [rad]. */
  double heading(std::size_t bin) const;
  /** The bin with most votes whose heading lies in [min, max]; empty when none has any. */
  std::optional<std::size_t> peak(double min, double max) const;

private:
  std::vector<double> votes_;
};

/** Where the next heading is expected (thesis 5.2): at first everywhere but near +-pi/2, then around the last one. */
class HeadingRegion
{
public:
  explicit HeadingRegion(const HeadingVoteParams& params);

  /** Right end of the region [rad]. */
  double min() const;
  /** Left end of the region [rad]. */
  double max() const;

  /**
   * The heading of the highest peak inside; moves the region there, and narrows or widens it. Empty, and the region
   * stays, when there is no vote inside.
   */
  std::optional<double> choose(const HeadingHistogram& histogram);

private:
  HeadingVoteParams params_;
  double centre_ = 0.0;  // [rad]
  double half_width_;    // [rad]
};

}  // namespace view_servo
