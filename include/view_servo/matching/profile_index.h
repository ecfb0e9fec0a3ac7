// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/profiles.h"
#include "view_servo/parameters/parameter.h"

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** Which reference profiles a current profile votes for (thesis 6.1.5). */
enum class ProfileSearch
{
  NEAREST,  ///< its K_v nearest
  RADIUS,   ///< all within D_v
  LEAF      ///< those in the leaf of the tree where it belongs, twelve at most: many of its nearest, without a search
};

/** Options of the search for similar profiles. */
struct ProfileSearchParams
{
  ProfileSearch search = ProfileSearch::NEAREST;
  int neighbours = 12;   ///< K_v (NEAREST): number of profiles each votes for; 25 find 2 % more, in 1.6 times the time
  double radius = 0.5;   ///< D_v (RADIUS): largest distance of similar profiles [standard deviations of a feature]
  double epsilon = 2.0;  ///< a neighbour found is at most 1 + epsilon times as far as the true one (NEAREST); 0: exact
  double share = 1.0;    ///< part of the current profiles that vote: those whose feature vectors are longest

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
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

/** The reference profiles similar to each current one; nearest first, but for ProfileSearch::LEAF. */
class SimilarProfiles
{
public:
  /** Some matches; refers to the SimilarProfiles that returned it. */
  struct Range
  {
    const ProfileMatch* first;
    const ProfileMatch* last;  ///< one behind the last match

    const ProfileMatch* begin() const
    {
      return first;
    }
    const ProfileMatch* end() const
    {
      return last;
    }
    std::size_t size() const
    {
      return static_cast<std::size_t>(last - first);
    }
    bool empty() const
    {
      return first == last;
    }
    const ProfileMatch& operator[](std::size_t i) const
    {
      return first[i];
    }
  };

  /**
   * @param begin those of profile i are matches[begin[i]] .. matches[begin[i + 1] - 1]; one more number than profiles.
   */
  SimilarProfiles(std::vector<ProfileMatch> matches, std::vector<std::size_t> begin)
    : matches_(std::move(matches)), begin_(std::move(begin))
  {
  }

  /** How many current profiles there are, those without similar ones included. */
  std::size_t size() const
  {
    return begin_.size() - 1;
  }
  /** Whether there are no current profiles. */
  bool empty() const
  {
    return size() == 0;
  }
  /** Those similar to the current profile of that index; empty where there are none. */
  Range operator[](std::size_t profile) const
  {
    return { matches_.data() + begin_[profile], matches_.data() + begin_[profile + 1] };
  }

private:
  std::vector<ProfileMatch> matches_;
  std::vector<std::size_t> begin_;
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
   * For each profile of `current` the similar ones of the reference; none for those that are not searched for. On all
   * of OpenCV's threads.
   * @throws std::invalid_argument when the two sets differ in their number of coefficients.
   */
  SimilarProfiles search(const ProfileSet& current, const ProfileSearchParams& params) const;

private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace view_servo
