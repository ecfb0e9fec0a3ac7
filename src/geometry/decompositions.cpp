// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/numbers.h"

#include "decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace view_servo
{
SymmetricEigen symmetricEigen(const Matrix9d& matrix)
{
  const Eigen::SelfAdjointEigenSolver<Matrix9d> solver(matrix);
  if (solver.info() != Eigen::Success)
  {
    return { Vector9d::Constant(NOT_A_NUMBER), Matrix9d::Constant(NOT_A_NUMBER) };
  }
  return { solver.eigenvalues(), solver.eigenvectors() };
}

Svd3 singularValues(const Eigen::Matrix3d& matrix)
{
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return { svd.matrixU(), svd.singularValues(), svd.matrixV() };
}

SmallVector solveSmallSymmetric(const SmallMatrix& a, const SmallVector& b)
{
  return a.ldlt().solve(b);
}

}  // namespace view_servo
