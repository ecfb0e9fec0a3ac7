// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "decompositions.h"
#include "normalization.h"

#include <Eigen/Core>

#include <cstddef>
#include <optional>

namespace view_servo
{
/** What solves a homogeneous linear system of the entries of a matrix. */
struct LinearEstimate
{
  Eigen::Matrix3d matrix;           ///< of points in normalised coordinates; the squares of its entries add up to 1
  PairNormalization normalization;  ///< of the points
};

/**
 * The 3x3 matrix that solves a homogeneous linear system best in the sense of least squares.
 * @param least number of pairs that determine it.
 * @param add void(const Correspondence& normalized, Matrix9d& sum): adds the lower block triangle of a pair's share of
 * A^T A, where A has the equations for the matrix' entries, row by row.
 * @return empty when there are fewer pairs, they cannot be normalised, or other solutions are as good.
 */
template <typename Add>
std::optional<LinearEstimate> solveLinearly(const Correspondences& pairs, std::size_t least, const Add& add)
{
  // On eigenvalues of A^T A, that is squared singular values, relative to the largest.
  constexpr double RANK_TOLERANCE = 1e-12;
  if (pairs.size() < least)
  {
    return std::nullopt;
  }
  const auto normalization = isotropicNormalization(pairs);
  if (!normalization)
  {
    return std::nullopt;
  }
  Matrix9d ata = Matrix9d::Zero();
  for (const Correspondence& pair : pairs)
  {
    add((*normalization)(pair), ata);
  }
  const SymmetricEigen eigen = symmetricEigen(ata);
  if (!(eigen.values(1) > RANK_TOLERANCE * eigen.values(8)))
  {
    return std::nullopt;
  }
  return LinearEstimate{ matrixFromRows(eigen.vectors.col(0)), *normalization };
}

}  // namespace view_servo
