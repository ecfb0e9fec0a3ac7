// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "matching/kd_tree.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int COLUMNS = 6;
using Tree = KdTree<COLUMNS>;

std::vector<float> randomVectors(int count, cv::RNG& rng)
{
  std::vector<float> vectors;
  for (int i = 0; i < count * COLUMNS; ++i)
  {
    vectors.push_back(static_cast<float>(rng.gaussian(1.0)));
  }
  return vectors;
}

/** Rounded, so that many are equal. */
std::vector<float> gridVectors(int count, cv::RNG& rng)
{
  std::vector<float> vectors = randomVectors(count, rng);
  std::transform(vectors.begin(), vectors.end(), vectors.begin(), [](float value) { return std::round(value); });
  return vectors;
}

/** Distances of all to the query, by their squares, sorted. */
std::vector<float> allDistances(const std::vector<float>& vectors, const float* query)
{
  std::vector<float> distances;
  for (std::size_t i = 0; i < vectors.size(); i += COLUMNS)
  {
    float sum = 0.0F;
    for (std::size_t c = 0; c < COLUMNS; ++c)
    {
      sum += (vectors[i + c] - query[c]) * (vectors[i + c] - query[c]);
    }
    distances.push_back(sum);
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

/** Each vector once, with its own distance, sorted. */
void expectConsistent(const std::vector<Tree::Neighbour>& found, const std::vector<float>& vectors, const float* query)
{
  std::set<std::uint32_t> seen;
  float last = 0.0F;
  for (const Tree::Neighbour& neighbour : found)
  {
    EXPECT_TRUE(seen.insert(neighbour.index).second) << neighbour.index << " is found twice";
    const auto begin = vectors.begin() + static_cast<std::ptrdiff_t>(neighbour.index) * COLUMNS;
    EXPECT_NEAR(neighbour.squared_distance, allDistances({ begin, begin + COLUMNS }, query).front(), 1e-4F);
    EXPECT_GE(neighbour.squared_distance, last);
    last = neighbour.squared_distance;
  }
}

TEST(KdTree, FindsTheNearest)
{
  cv::RNG rng(1);
  for (const int count : { 1, 2, 31, 32, 33, 700 })
  {
    for (const bool grid : { false, true })
    {
      SCOPED_TRACE(count);
      const std::vector<float> vectors = grid ? gridVectors(count, rng) : randomVectors(count, rng);
      const Tree tree(vectors);
      const std::vector<float> queries = randomVectors(20, rng);
      for (std::size_t q = 0; q < queries.size(); q += COLUMNS)
      {
        const std::vector<float> all = allDistances(vectors, queries.data() + q);
        std::vector<Tree::Neighbour> found;
        tree.findNearest(queries.data() + q, 12, 0.0F, found);
        expectConsistent(found, vectors, queries.data() + q);
        ASSERT_EQ(found.size(), std::min<std::size_t>(12, all.size()));
        for (std::size_t i = 0; i < found.size(); ++i)
        {
          EXPECT_NEAR(found[i].squared_distance, all[i], 1e-4F);
        }
      }
    }
  }
}

TEST(KdTree, MissesNothingBeyondTheTolerance)
{
  cv::RNG rng(2);
  const std::vector<float> vectors = randomVectors(5000, rng);
  const Tree tree(vectors);
  const std::vector<float> queries = randomVectors(1000, rng);
  constexpr float TOLERANCE = 1.0F;
  int inexact = 0;
  for (std::size_t q = 0; q < queries.size(); q += COLUMNS)
  {
    std::vector<Tree::Neighbour> found;
    tree.findNearest(queries.data() + q, 1, TOLERANCE, found);
    const float nearest = std::sqrt(allDistances(vectors, queries.data() + q).front());
    ASSERT_EQ(found.size(), 1U);
    const float distance = std::sqrt(found.front().squared_distance);
    EXPECT_LE(distance, (1.0F + TOLERANCE) * nearest * 1.0001F);
    inexact += distance > 1.0001F * nearest ? 1 : 0;
  }
  EXPECT_GT(inexact, 0) << "the tolerance saves nothing";
}

TEST(KdTree, FindsAllWithinARadius)
{
  cv::RNG rng(3);
  const std::vector<float> vectors = randomVectors(1500, rng);
  const Tree tree(vectors);
  const std::vector<float> queries = randomVectors(50, rng);
  std::size_t total = 0;
  for (std::size_t q = 0; q < queries.size(); q += COLUMNS)
  {
    constexpr float RADIUS = 1.2F;
    std::vector<Tree::Neighbour> found;
    tree.findWithin(queries.data() + q, RADIUS, found);
    expectConsistent(found, vectors, queries.data() + q);
    const std::vector<float> all = allDistances(vectors, queries.data() + q);
    EXPECT_EQ(static_cast<std::ptrdiff_t>(found.size()),
              std::lower_bound(all.begin(), all.end(), RADIUS * RADIUS) - all.begin());
    total += found.size();
  }
  EXPECT_GT(total, 100U);
}

TEST(KdTree, HoldsVectorsThatAreAllEqual)
{
  const std::vector<float> vectors(1000 * COLUMNS, 0.25F);
  const Tree tree(vectors);
  std::vector<Tree::Neighbour> found;
  tree.findNearest(vectors.data(), 40, 0.0F, found);
  EXPECT_EQ(found.size(), 40U);
  tree.findWithin(vectors.data(), 0.1F, found);
  EXPECT_EQ(found.size(), 1000U);
  expectConsistent(found, vectors, vectors.data());
}

TEST(KdTree, AnEmptyOneFindsNothing)
{
  const float query[COLUMNS] = {};
  std::vector<Tree::Neighbour> found(3);
  Tree().findNearest(query, 5, 0.0F, found);
  EXPECT_TRUE(found.empty());
  Tree(std::vector<float>()).findWithin(query, std::numeric_limits<float>::infinity(), found);
  EXPECT_TRUE(found.empty());
}

}  // namespace
}  // namespace view_servo
