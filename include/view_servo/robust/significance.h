// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace view_servo
{
/**
 * -log10 of the expected number of models with as many inliers when all matches are made by chance (a-contrario, Moisan
 * & Stival 2004): (n - s) C(n, k) C(k, s) p^(k - s), for n candidates, k inliers and samples of s.
 * @param probability p, that a match made by chance agrees with a model.
 */
double logSignificance(std::size_t candidates, std::size_t inliers, int sample_size, double probability);

/**
 * log10 of an upper bound (Chernoff's) of the probability that at least `successes` of `count` independent events
 * happen, each of which has `probability`; 0 when that many are expected anyway. For events of different probabilities
 * their mean may be given.
 */
double logBinomialTail(std::size_t count, std::size_t successes, double probability);

/**
 * The share of wrong pairs, made of one inlier's reference position and another inlier's current position, that agree
 * with the model as well. It is large when the positions lie along one epipolar line, such as the edge of a floor:
 * these agree with whatever they are matched.
 * @param agrees bool(std::size_t reference, std::size_t current), both indices of inliers.
 */
template <typename Agrees>
double chanceAmong(std::size_t inliers, const Agrees& agrees)
{
  constexpr std::size_t TRIED = 5000;
  std::size_t tried = 0;
  std::size_t agreeing = 0;
  for (std::size_t shift = 1; shift < inliers && tried < TRIED; ++shift)
  {
    for (std::size_t i = 0; i < inliers; ++i)
    {
      agreeing += agrees(i, (i + shift) % inliers) ? 1 : 0;
    }
    tried += inliers;
  }
  return tried > 0 ? static_cast<double>(agreeing) / static_cast<double>(tried) : 0.0;
}

}  // namespace view_servo
