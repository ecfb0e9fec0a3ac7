// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/profiles.h"
#include "view_servo/parameters/parameter.h"

#include <memory>
#include <string>
#include <vector>

namespace view_servo
{
/** Which reference profiles a current profile votes for (thesis 6.1.5). */
enum class ProfileSearch
{
  NEAREST,  ///< its K_v nearest
  RADIUS    ///< all within D_v
};

struct ProfileSearchParams
{
  ProfileSearch search = ProfileSearch::NEAREST;
  int neighbours = 12;   ///< K_v (NEAREST): number of profiles each votes for; 25 find 2 % more, in 1.6 times the time
  double radius = 0.5;   ///< D_v (RADIUS): distance of similar profiles [standard deviations of a feature]
  double epsilon = 3.0;  ///< a neighbour found is at most (1 + epsilon) times farther than the true one (NEAREST)
  double share = 1.0;    ///< part of the current profiles that vote: those whose feature vectors are longest

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ProfileSearchParams& params);

/** A reference profile found similar to a current one. */
struct ProfileMatch
{
  int reference;  ///< index into the reference's ProfileSet::pairs
  bool reversed;  ///< the reference profile, read from end to start, is similar to the current one from start to end
};

/** Kd-tree over the profiles of a reference image, in both directions. */
class ProfileIndex
{
public:
  /** The index copies what it needs of `profiles`. */
  explicit ProfileIndex(const ProfileSet& profiles);
  ~ProfileIndex();
  ProfileIndex(ProfileIndex&&) noexcept;
  ProfileIndex& operator=(ProfileIndex&&) noexcept;

  /**
   * For each profile of `current` the similar ones of the reference, nearest first; none for those that are not
   * searched for. On all of OpenCV's threads.
   * @throws std::invalid_argument when the two sets differ in their number of coefficients.
   */
  std::vector<std::vector<ProfileMatch>> search(const ProfileSet& current, const ProfileSearchParams& params) const;

private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace view_servo
