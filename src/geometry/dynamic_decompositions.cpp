// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "decompositions.h"

namespace view_servo
{
SymmetricDecomposition::SymmetricDecomposition(const Eigen::MatrixXd& matrix) : ldlt_(matrix)
{
}

Eigen::VectorXd SymmetricDecomposition::solve(const Eigen::VectorXd& b) const
{
  return ldlt_.solve(b);
}

Eigen::MatrixXd SymmetricDecomposition::inverse() const
{
  return ldlt_.solve(Eigen::MatrixXd::Identity(ldlt_.rows(), ldlt_.cols()));
}

Eigen::VectorXd SymmetricDecomposition::diagonal() const
{
  return ldlt_.vectorD();
}

Eigen::VectorXd solveSymmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b)
{
  return SymmetricDecomposition(a).solve(b);
}

Eigen::MatrixXd whiteningOf(const Eigen::MatrixXd& covariance)
{
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  return cholesky.matrixL().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b)
{
  return a * b;
}

Eigen::VectorXd applied(const Eigen::MatrixXd& a, const Eigen::VectorXd& x)
{
  return a * x;
}

}  // namespace view_servo
