// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "normalization.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace view_servo
{
/** @file
 * Decompositions of small matrices by Eigen. They are compiled in one place, as each takes a compiler seconds.
 */

/** Of a symmetric matrix. */
struct SymmetricEigen
{
  Vector9d values;   ///< in ascending order
  Matrix9d vectors;  ///< columns
};

/** @return NaN where the matrix has entries that are not finite. */
SymmetricEigen symmetricEigen(const Matrix9d& matrix);

/** matrix = u diag(values) v^T, the values in descending order. */
struct Svd3
{
  Eigen::Matrix3d u;
  Eigen::Vector3d values;
  Eigen::Matrix3d v;
};

Svd3 singularValues(const Eigen::Matrix3d& matrix);

/** The solution x of A x = b, A symmetric and positive semidefinite. */
template <int N>
Eigen::Matrix<double, N, 1> solveSymmetric(const Eigen::Matrix<double, N, N>& a, const Eigen::Matrix<double, N, 1>& b)
{
  return a.ldlt().solve(b);
}

extern template Eigen::Matrix<double, 2, 1> solveSymmetric(const Eigen::Matrix<double, 2, 2>&,
                                                           const Eigen::Matrix<double, 2, 1>&);
extern template Eigen::Matrix<double, 3, 1> solveSymmetric(const Eigen::Matrix<double, 3, 3>&,
                                                           const Eigen::Matrix<double, 3, 1>&);
extern template Eigen::Matrix<double, 5, 1> solveSymmetric(const Eigen::Matrix<double, 5, 5>&,
                                                           const Eigen::Matrix<double, 5, 1>&);
extern template Eigen::Matrix<double, 7, 1> solveSymmetric(const Eigen::Matrix<double, 7, 7>&,
                                                           const Eigen::Matrix<double, 7, 1>&);
extern template Eigen::Matrix<double, 9, 1> solveSymmetric(const Eigen::Matrix<double, 9, 9>&,
                                                           const Eigen::Matrix<double, 9, 1>&);

}  // namespace view_servo
