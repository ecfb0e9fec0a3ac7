// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/features/profiles.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/association.h"
#include "view_servo/matching/profile_index.h"
#include "view_servo/parameters/parameter.h"

#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace view_servo
{
/** How one-to-one candidates are taken from an association. */
enum class AssignmentMethod
{
  EXACT,  ///< maximumWeightMatching()
  GREEDY  ///< greedyMatching()
};

/** Options of matching by intensity profiles (thesis ch. 6 and 7). */
struct PointMatcherParams
{
  CornerParams corners;
  ProfileParams profiles;
  ProfileSearchParams search;
  AssignmentMethod assignment = AssignmentMethod::EXACT;
  bool cyclic_order = true;      ///< weigh associations by cyclic alignment of the profiles that voted (ch. 7)
  double min_correlation = 0.7;  ///< least correlation of two profiles' features for them to be aligned (7.3)
  /** At most this many entries of each row and of each column are aligned, those of most votes; 0 = all. */
  int cyclic_entries = 5;

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PointMatcherParams& params);

/** A profile as seen from its ends. */
struct ProfileEnds
{
  /**
   * Orders it among the profiles that start where it starts. The upper half is the angle (as the monotonic and cheaper
   * diamond angle, in 2^14 steps a quadrant), the lower half the corner at the other end: so that all at a corner
   * differ.
   */
  std::uint32_t from_start;
  std::uint32_t from_end;  ///< the same among the profiles at its end, with its start as the corner at the other end
  float inverse_length;    ///< 1 / length of the vector of its features; 0 where that is 0

  /** Index of the corner where it starts. */
  std::uint32_t start() const
  {
    return from_end & 0xFFFFU;
  }
  /** Index of the corner where it ends. */
  std::uint32_t end() const
  {
    return from_start & 0xFFFFU;
  }
};

/** What matching needs of one image. */
struct PointFeatures
{
  std::vector<Corner> corners;
  ProfileSet profiles;
  std::vector<ProfileEnds> ends;  ///< one for each profile
};

/**
 * The ends of all profiles between corners.
 * @throws std::invalid_argument when there are more than 65536 corners.
 */
std::vector<ProfileEnds> profileEnds(const std::vector<Corner>& corners, const ProfileSet& profiles);

/** Corners and profiles of an 8-bit, one-channel image; mask as in detectCorners(). */
PointFeatures extractPointFeatures(const cv::Mat& image, const PointMatcherParams& params,
                                   const cv::Mat& mask = cv::Mat());

/**
 * Association of the corners of two images by the votes of their similar profiles: 1/K_v for start with start and end
 * with end (6.1.4). With `cyclic_order` an entry's weight is that of the best one-to-one, cyclically ordered alignment
 * of the profiles that voted for it (eq. 7.4), and entries not aligned are left out.
 * @param index the index over reference.profiles.
 */
AssociationMatrix associatePoints(const PointFeatures& reference, const ProfileIndex& index,
                                  const PointFeatures& current, const PointMatcherParams& params);

/** One-to-one candidates from an association, best first. */
std::vector<Association> candidateMatches(const AssociationMatrix& association, AssignmentMethod method);

}  // namespace view_servo
