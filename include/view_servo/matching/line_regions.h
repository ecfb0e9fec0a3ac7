// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/matching/association.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * From votes to matches: regions of the image, in each of which one homography maps neighbouring segments onto
 * segments.
 */

/** Options of finding regions. */
struct LineRegionParams
{
  int max_candidates = 8;             ///< counterparts tried for a segment, those of most votes
  int max_trials = 600;               ///< candidates tried in all, beginning with those that stand out most
  int max_companions = 12;            ///< matches of neighbours tried with a candidate, those of most votes
  int max_hypotheses = 3;             ///< affine maps scored for a candidate, those whose three segments agree best
  double affine_tolerance = 3.0;      ///< largest distance across of segments that agree with a local affine map [px]
  double tolerance = 2.0;             ///< largest distance across of segments that agree with a homography [px]
  double max_angle_deg = 10.0;        ///< largest angle between a mapped segment and its counterpart [deg]
  double min_support = 5.0;           ///< least sum of 0.3 + 0.7 SegmentMatch::share over a region's matches
  double min_correlation = 0.55;      ///< least sideCorrelation() of a match
  double min_mean_correlation = 0.6;  ///< least mean sideCorrelation() of a region's matches

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LineRegionParams& params);

/** A segment and its counterpart, by their indices. */
struct SegmentMatch
{
  int reference;             ///< index of the segment in the reference image
  int current;               ///< index of the segment in the current image
  double share;              ///< length side by side over the length that both cover, in the current image, (0, 1]
  double correlation = 0.0;  ///< sideCorrelation(), [-1, 1]
};

/** Matches of neighbouring segments that agree with one homography. */
struct LineRegion
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();  ///< homography x_cur ~ H x_ref [px]
  std::vector<SegmentMatch> matches;
  double support = 0.0;  ///< sum over the matches of (0.3 + 0.7 share) x correlation
};

/**
 * Regions, in the order they were found (strongest votes first). Each candidate match is tried with those neighbours
 * that meet its segments alike: three lines give an affine map, which is judged by the segments around. A map with
 * enough support becomes a homography, whose region grows outwards as long as segments agree. A segment that is in a
 * region starts no other. Time is bounded by max_trials x (max_companions² / 2 + max_hypotheses x neighbours²).
 */
std::vector<LineRegion> findLineRegions(const LineFeatures& reference, const LineFeatures& current,
                                        const AssociationMatrix& association, const LineRegionParams& params);

/**
 * The region that grows from a homography and the matches, at least three, that gave it. Empty when the images beside
 * its segments do not look alike on average, or when the matches that do look alike have less than params.min_support.
 */
std::optional<LineRegion> growLineRegion(const LineFeatures& reference, const LineFeatures& current,
                                         const Eigen::Matrix3d& h, const std::vector<SegmentMatch>& matches,
                                         const LineRegionParams& params);

/**
 * What each region's segments support at the best other place where they would be farther away, at less than 0.6 of the
 * area. A region that has much of its support there, too, may be either: of doors along a corridor the nearest shows
 * most segments, so that most are found there, whichever door it was.
 * @return LineRegion::support of the region's segments there, of each region; 0 where there is no such place.
 */
std::vector<double> supportFartherAway(const LineFeatures& reference, const LineFeatures& current,
                                       const AssociationMatrix& association, const std::vector<LineRegion>& regions,
                                       const LineRegionParams& params);

/** Directions in the current image that evidenceOf() tells apart: 45 degrees apart, along u first, then towards v. */
constexpr std::size_t LINE_DIRECTIONS = 4;

/** Of the segments that lie across one direction: how many are found where a homography sends them, how many beside. */
struct LineEvidence
{
  std::size_t seen = 0;    ///< segments sent into the current image
  std::size_t found = 0;   ///< of the seen ones, those for which a segment is there that looks alike
  std::size_t tried = 0;   ///< trials of sending a segment 10, 17 or 27 px aside, both ways: six for each one seen
  std::size_t beside = 0;  ///< trials that came to a place where a segment is that looks alike

  /** Probability that a segment is found where it does not belong, as the rule of succession estimates it, (0, 1). */
  double chance() const
  {
    return (static_cast<double>(beside) + 1.0) / (static_cast<double>(tried) + 2.0);
  }
  LineEvidence& operator+=(const LineEvidence& other);
};

/**
 * What the reference segments in the box around a region's matches say of its homography, for each direction. For a
 * direction only segments at 45 degrees or more to it count, as only they show a shift along it. Whether a segment is
 * matched does not matter, but those that `others` marks are left out.
 * @param others for each reference segment, whether another region has matched it.
 */
std::array<LineEvidence, LINE_DIRECTIONS> evidenceOf(const LineRegion& region, const LineFeatures& reference,
                                                     const LineFeatures& current, const std::vector<char>& others,
                                                     const LineRegionParams& params);

}  // namespace view_servo
