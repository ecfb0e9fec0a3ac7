// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace view_servo
{
/**
 * Best one-to-one alignment of two cyclic strings that keeps the cyclic order (thesis 7.3, eq. 7.4).
 *
 * Weighted longest common subsequence over all rotations of the second string, exact, by divide and conquer over the
 * rotations: an optimal path of a rotation can always be found between those of a smaller and a larger one, so each
 * is confined to the band between two found before (Maes 1990; Gregor & Thomason 1993). O(m n log n) for m x n weights.
 * Moving one column from the front to the back gains its largest weight at most, so that rotations between two poor
 * ones are left out where they cannot reach the best.
 *
 * An object keeps its work space between calls: one per thread.
 */
class CyclicAligner
{
public:
  /**
   * Largest total weight of pairs (r_1, c_1), .., (r_p, c_p) with r_k strictly increasing and, after some rotation of
   * the columns, c_k strictly increasing.
   * @param weights rows x columns, row-major, each >= 0.
   */
  float align(const float* weights, int rows, int columns);

private:
  /** For each row of the table, the first and the last column on a path. */
  struct Path
  {
    std::vector<int> first;
    std::vector<int> last;
  };

  /** A rotation with its best weight, and where its path is kept. */
  struct Rotation
  {
    int columns;       // by how many columns the second string is rotated
    float weight;      // of its best alignment
    std::size_t path;  // index into paths_
  };

  /** Best weight of one rotation, whose path lies between two others (null: no limit); sets `path`. */
  float alignRotation(int rotation, const Path* left, const Path* right, Path& path);
  /** Tries the rotations between two, and keeps the best weight in best_. */
  void divide(const Rotation& left, const Rotation& right);

  int rows_ = 0;
  int columns_ = 0;
  float best_ = 0.0F;
  std::vector<float> weights_;  // rows_ x 2 columns_: each row of the caller's twice
  std::vector<float> gains_;    // of the first k columns together: sums of their largest weights
  std::vector<float> table_;    // (rows_ + 1) x (2 columns_ + 1)
  std::vector<Path> paths_;     // a stack: two for the ends, one a level of division
  std::size_t stack_size_ = 0;
};

}  // namespace view_servo
