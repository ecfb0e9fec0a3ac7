// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "normalization.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace view_servo
{
/** @file
 * Decompositions of matrices, and products of matrices of any size, by Eigen. Each is compiled in one place, as it
 * takes a compiler seconds.
 */

/** Eigenvalues and eigenvectors of a symmetric matrix. */
struct SymmetricEigen
{
  Vector9d values;   ///< eigenvalues in ascending order
  Matrix9d vectors;  ///< unit eigenvectors in the same order, one a column
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

/** Up to 9 x 9, without memory from the heap. */
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 9, 9>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 9, 1>;

/** The solution x of A x = b, A symmetric and positive semidefinite. */
SmallVector solveSmallSymmetric(const SmallMatrix& a, const SmallVector& b);

/** solveSmallSymmetric() for a size that is known: one for each would take a compiler five seconds each. */
template <int N>
Eigen::Matrix<double, N, 1> solveSymmetric(const Eigen::Matrix<double, N, N>& a, const Eigen::Matrix<double, N, 1>& b)
{
  return solveSmallSymmetric(a, b);
}

/** L D Lᵀ of a symmetric, positive semidefinite matrix of any size, its rows exchanged where that is more exact. */
class SymmetricDecomposition
{
public:
  explicit SymmetricDecomposition(const Eigen::MatrixXd& matrix);

  /** The solution x of A x = b. */
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

  Eigen::MatrixXd inverse() const;

  /** The diagonal of D. */
  Eigen::VectorXd diagonal() const;

private:
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};

/** solveSymmetric() for any size. */
Eigen::VectorXd solveSymmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

/** L⁻¹ of a covariance L Lᵀ that is positive definite: errors times it have a covariance of identity. */
Eigen::MatrixXd whiteningOf(const Eigen::MatrixXd& covariance);

/** The product a b. */
Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/** The product a x. */
Eigen::VectorXd applied(const Eigen::MatrixXd& a, const Eigen::VectorXd& x);

}  // namespace view_servo
