// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/rotation_vector.h"

#include "decompositions.h"
#include "normalization.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>

namespace view_servo
{
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix9x7d = Eigen::Matrix<double, 9, 7>;

/** @file
 * Geometric residuals of one correspondence and their derivatives by the nine row-major entries of the matrix, in the
 * units of the points; and the parameters over which a matrix of rank 2 is refined.
 */

/** Residual of a point transferred into the other image. Its 2x9 Jacobian by H is `derivative` (x) `point`^T. */
struct TransferResidual
{
  Eigen::Vector2d residual;                ///< transferred less observed point
  Eigen::Matrix<double, 2, 3> derivative;  ///< of the residual by H times `point`
  Eigen::Vector3d point;                   ///< homogeneous point that dH is multiplied by

  Eigen::Matrix<double, 2, 9> jacobian() const
  {
    Eigen::Matrix<double, 2, 9> j;
    j << derivative.col(0) * point.transpose(), derivative.col(1) * point.transpose(),
        derivative.col(2) * point.transpose();
    return j;
  }
};

/** Derivative of the image point of x, (x1, x2) / x3, by x. */
inline Eigen::Matrix<double, 2, 3> projectionDerivative(const Eigen::Vector3d& x)
{
  const double scale = 1.0 / x.z();
  Eigen::Matrix<double, 2, 3> d;
  d << scale, 0.0, -x.x() * scale * scale, 0.0, scale, -x.y() * scale * scale;
  return d;
}

/** H x_ref - x_cur; x_ref must not map to infinity. */
inline TransferResidual forwardResidual(const Eigen::Matrix3d& h, const Correspondence& pair)
{
  const Eigen::Vector3d reference = pair.reference.homogeneous();
  const Eigen::Vector3d x = h * reference;
  return { x.hnormalized() - pair.current, projectionDerivative(x), reference };
}

/** H^-1 x_cur - x_ref, differentiated by H (not its inverse): with y = H^-1 x_cur, dy = -H^-1 dH y. */
inline TransferResidual backwardResidual(const Eigen::Matrix3d& h_inverse, const Correspondence& pair)
{
  const Eigen::Vector3d y = h_inverse * pair.current.homogeneous();
  return { y.hnormalized() - pair.reference, -projectionDerivative(y) * h_inverse, y };
}

/**
 * Signed Sampson distance (thesis eq. 9.2 before squaring), and its 1x9 Jacobian by F. NaN where both points are
 * epipoles.
 */
inline double sampsonResidual(const Eigen::Matrix3d& f, const Correspondence& pair,
                              Eigen::Matrix<double, 1, 9>& jacobian)
{
  const Eigen::Vector3d reference = pair.reference.homogeneous();
  const Eigen::Vector3d current = pair.current.homogeneous();
  Eigen::Vector3d line = f * reference;
  Eigen::Vector3d back_line = f.transpose() * current;
  const double algebraic = current.dot(line);
  line.z() = 0.0;
  back_line.z() = 0.0;
  const double squared_gradient = line.squaredNorm() + back_line.squaredNorm();
  const double gradient = std::sqrt(squared_gradient);
  // d(n/g) = dn/g - (n/g^3) (l dl + l' dl'), with dn = x_cur^T dF x_ref, dl = dF x_ref, dl' = dF^T x_cur
  const Eigen::Vector3d left = (current - (algebraic / squared_gradient) * line) / gradient;
  const Eigen::Vector3d right = (-algebraic / (squared_gradient * gradient)) * back_line;
  for (int i = 0; i < 3; ++i)
  {
    jacobian.segment<3>(3 * i) = left(i) * reference.transpose() + current(i) * right.transpose();
  }
  return algebraic / gradient;
}

/** F = U diag(cos p, sin p, 0) V^T, U and V rotations (orthonormal representation, Bartoli & Sturm 2004). */
struct Orthonormal
{
  Eigen::Matrix3d u;
  Eigen::Matrix3d v;
  double p;

  explicit Orthonormal(const Eigen::Matrix3d& f)
  {
    const Svd3 svd = singularValues(f);
    u = svd.u;
    v = svd.v;
    // The third columns meet the zero singular value: their signs are free.
    u.col(2) *= u.determinant() < 0.0 ? -1.0 : 1.0;
    v.col(2) *= v.determinant() < 0.0 ? -1.0 : 1.0;
    p = std::atan2(svd.values(1), svd.values(0));
  }

  Eigen::Matrix3d matrix() const
  {
    return u * Eigen::Vector3d(std::cos(p), std::sin(p), 0.0).asDiagonal() * v.transpose();
  }

  /** After a step in the seven parameters: rotation vectors to the right of U and V [rad], and p [rad]. */
  Orthonormal moved(const Vector7d& step) const
  {
    Orthonormal next = *this;
    next.u = u * rotationFromVector(step.head<3>());
    next.v = v * rotationFromVector(step.segment<3>(3));
    next.p += step(6);
    return next;
  }

  /** Derivatives of the row-major entries of F by the seven parameters, at a step of zero. */
  Matrix9x7d derivatives() const
  {
    const Eigen::DiagonalMatrix<double, 3> s(std::cos(p), std::sin(p), 0.0);
    Matrix9x7d d;
    const auto set = [&d](int column, const Eigen::Matrix3d& m) {
      d.col(column) = rowMajor(m);
    };
    for (int k = 0; k < 3; ++k)
    {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(k);
      const Eigen::Matrix3d cross = crossMatrix(e);
      set(k, u * cross * s * v.transpose());
      set(3 + k, u * s * cross.transpose() * v.transpose());
    }
    set(6, u * Eigen::Vector3d(-std::sin(p), std::cos(p), 0.0).asDiagonal() * v.transpose());
    return d;
  }
};

}  // namespace view_servo
