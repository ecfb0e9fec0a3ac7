// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/cyclic_alignment.h"

#include "view_servo/robust/ransac.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace
{
using view_servo::CyclicAligner;

/** Weighted longest common subsequence of the rows with the columns rotated to begin at `rotation` (algorithm 1). */
float linearAlignment(const std::vector<float>& weights, int rows, int columns, int rotation)
{
  std::vector<std::vector<float>> c(static_cast<std::size_t>(rows + 1),
                                    std::vector<float>(static_cast<std::size_t>(columns + 1), 0.0F));
  for (int i = 1; i <= rows; ++i)
  {
    for (int j = 1; j <= columns; ++j)
    {
      const float weight = weights[static_cast<std::size_t>((i - 1) * columns + (j - 1 + rotation) % columns)];
      c[i][j] = std::max({ c[i - 1][j], c[i][j - 1], c[i - 1][j - 1] + weight });
    }
  }
  return c[static_cast<std::size_t>(rows)][static_cast<std::size_t>(columns)];
}

float allRotations(const std::vector<float>& weights, int rows, int columns)
{
  float best = 0.0F;
  for (int rotation = 0; rotation < columns; ++rotation)
  {
    best = std::max(best, linearAlignment(weights, rows, columns, rotation));
  }
  return best;
}

std::vector<float> unitWeights(const std::string& a, const std::string& b)
{
  std::vector<float> weights;
  for (const char x : a)
  {
    for (const char y : b)
    {
      weights.push_back(x == y ? 1.0F : 0.0F);
    }
  }
  return weights;
}

TEST(CyclicAligner, SolvesTheExampleOfTheThesis)
{
  const std::vector<float> weights = unitWeights("CDABBAA", "ABCD");
  float votes = 0.0F;
  for (const float weight : weights)
  {
    votes += weight;
  }
  EXPECT_EQ(votes, 7.0F);
  EXPECT_EQ(linearAlignment(weights, 7, 4, 0), 2.0F);
  EXPECT_EQ(CyclicAligner().align(weights.data(), 7, 4), 4.0F);
}

TEST(CyclicAligner, EqualsBruteForceOnRandomWeightedStrings)
{
  view_servo::Rng rng(3);
  CyclicAligner aligner;
  for (int trial = 0; trial < 10000; ++trial)
  {
    const int rows = 1 + static_cast<int>(view_servo::uniformIndex(rng, 14));
    const int columns = 1 + static_cast<int>(view_servo::uniformIndex(rng, 14));
    const std::size_t density = 1 + view_servo::uniformIndex(rng, 8);
    // Multiples of 1/8 add without rounding, and make many ties.
    std::vector<float> weights;
    for (int i = 0; i < rows * columns; ++i)
    {
      const bool matched = view_servo::uniformIndex(rng, 8) < density;
      weights.push_back(matched ? static_cast<float>(view_servo::uniformIndex(rng, 9)) / 8.0F : 0.0F);
    }
    ASSERT_EQ(aligner.align(weights.data(), rows, columns), allRotations(weights, rows, columns))
        << "trial " << trial << ", " << rows << " x " << columns;
  }
}

TEST(CyclicAligner, DoesNotDependOnWhereTheStringsBegin)
{
  const std::string a = "ABCDEFGH";
  CyclicAligner aligner;
  for (std::size_t shift = 0; shift < a.size(); ++shift)
  {
    const std::string b = a.substr(shift) + a.substr(0, shift);
    EXPECT_EQ(aligner.align(unitWeights(a, b).data(), 8, 8), 8.0F);
    EXPECT_EQ(aligner.align(unitWeights(b, a).data(), 8, 8), 8.0F);
  }
}

TEST(CyclicAligner, FindsTwoAtMostInAReversedString)
{
  // Three different letters have a cyclic order; any two agree with their mirror image.
  EXPECT_EQ(CyclicAligner().align(unitWeights("ABCDEFGH", "HGFEDCBA").data(), 8, 8), 2.0F);
}

TEST(CyclicAligner, OfNothingIsNothing)
{
  EXPECT_EQ(CyclicAligner().align(nullptr, 0, 5), 0.0F);
  EXPECT_EQ(CyclicAligner().align(nullptr, 5, 0), 0.0F);
}

}  // namespace
