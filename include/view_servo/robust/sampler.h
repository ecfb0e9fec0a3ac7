// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/matching/association.h"
#include "view_servo/robust/random.h"

#include <cstddef>
#include <vector>

namespace view_servo
{
/** Where the samples of the RANSAC loop come from. Samples are indices of the estimator's data, all different. */
class Sampler
{
public:
  virtual ~Sampler() = default;

  /** Sets `sample` to a new one. False when none can be drawn; `sample` is then without meaning. */
  virtual bool draw(Rng& rng, std::vector<int>& sample) = 0;

  /** Probability that a datum drawn belongs to `inliers` (ascending), for the adaptive stop (thesis eq. 9.5). */
  virtual double share(const std::vector<int>& inliers) const = 0;

  /** Number of candidates that the improvement stage (thesis 9.4) tries at each position of the best sample. */
  virtual int replacements() const = 0;

  /**
   * Replaces the sample's entry at `position` by another datum: number `trial` of those that are tried in turn, or one
   * that is drawn, as the sampler has it. False, and nothing changes, when none fits there.
   */
  virtual bool replace(Rng& rng, int trial, std::size_t position, std::vector<int>& sample) const = 0;
};

/** How samples are drawn from a list of data. */
enum class Sampling
{
  UNIFORM,     ///< every datum equally likely
  PROGRESSIVE  ///< from the best-first prefix, growing (PROSAC, Chum & Matas 2005); data must be sorted best first
};

/**
 * Samples from a list: uniform, or from a growing best-first prefix (PROSAC; Chum & Matas 2005, sec. 2.1). The prefix
 * grows as in the paper, with T_N = `schedule_length`; once it is the whole list, samples are uniform.
 */
class ListSampler : public Sampler
{
public:
  /** From the data 0 .. count - 1, in this order. @param size of a sample, > 0. */
  ListSampler(Sampling sampling, std::size_t count, std::size_t size, double schedule_length);

  /** From the given data, in their order. */
  ListSampler(Sampling sampling, std::vector<int> data, std::size_t size, double schedule_length);

  bool draw(Rng& rng, std::vector<int>& sample) override;
  double share(const std::vector<int>& inliers) const override;
  int replacements() const override
  {
    return static_cast<int>(data_.size());
  }
  bool replace(Rng& rng, int trial, std::size_t position, std::vector<int>& sample) const override;

private:
  std::vector<int> data_;    ///< in the order given
  std::vector<int> sorted_;  ///< the same, ascending
  std::size_t size_;         ///< number of data in a sample
  std::size_t prefix_;       ///< n: samples come from the best n data
  double prefix_samples_;    ///< T_n: samples expected from within the best n, real-valued
  double samples_drawn_;     ///< t: samples drawn so far
  double samples_to_grow_;   ///< T'_n: n grows when t passes it
};

/**
 * Samples of the entries of an association matrix, each drawn with a probability proportional to its weight, no two in
 * one row or column (importance sampling; thesis 9.3). Data are the indices of its entries.
 */
class ImportanceSampler : public Sampler
{
public:
  /**
   * Keeps a reference to the association.
   * @param size of a sample, > 0. @param replacements see replacements(); N2 of Algorithm 2.
   */
  ImportanceSampler(const AssociationMatrix& association, std::size_t size, int replacements);

  bool draw(Rng& rng, std::vector<int>& sample) override;
  double share(const std::vector<int>& inliers) const override;
  int replacements() const override
  {
    return replacements_;
  }
  bool replace(Rng& rng, int trial, std::size_t position, std::vector<int>& sample) const override;

private:
  /** Index of an entry, drawn with a probability proportional to its weight. */
  int drawEntry(Rng& rng) const;
  /** Whether an entry shares a row or column with an entry of the sample, the one at `except` left aside. */
  bool collides(int entry, const std::vector<int>& sample, std::size_t except) const;

  const AssociationMatrix& association_;
  std::size_t size_;  ///< number of entries in a sample
  int replacements_;
  std::vector<double> cumulated_;  ///< sums of the weights from the first entry to each one
};

namespace detail
{
/** Replaces `sample` by `size` distinct indices in [0, count), every set equally likely (Floyd). size <= count. */
void drawDistinct(Rng& rng, std::size_t count, std::size_t size, std::vector<int>& sample);
}  // namespace detail

}  // namespace view_servo
