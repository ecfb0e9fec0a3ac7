// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace view_servo
{
/**
 * -log10 of the number of models with this many inliers to be expected among matches made by chance (a-contrario,
 * Moisan & Stival 2004): (n - s) C(n, k) C(k, s) p^(k - s), with p the probability that a random match agrees.
 */
double logSignificance(std::size_t candidates, std::size_t inliers, int sample_size, double probability);

/**
 * How often the reference position of one inlier and the current one of another agree, too. Often, when the positions
 * lie along an epipolar line, say the edge of a floor: then they agree whatever they are matched with.
 * @param agrees bool(std::size_t reference, std::size_t current).
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
