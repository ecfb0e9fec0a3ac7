// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/fundamental.h"

#include "levenberg_marquardt.h"
#include "linear_estimate.h"
#include "normalization.h"
#include "residuals.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
/** F in pixels, of norm 1, from F between normalised points. */
Eigen::Matrix3d denormalized(const Eigen::Matrix3d& f, const PairNormalization& normalization)
{
  return (normalization.current.matrix().transpose() * f * normalization.reference.matrix()).normalized();
}

Eigen::Matrix3d cofactors(const Eigen::Matrix3d& m)
{
  Eigen::Matrix3d c;
  c.row(0) = m.row(1).cross(m.row(2));
  c.row(1) = m.row(2).cross(m.row(0));
  c.row(2) = m.row(0).cross(m.row(1));
  return c;
}

/** Coefficients of det(x a + y b), a cubic form: x^3, x^2 y, x y^2, y^3. */
std::array<double, 4> determinantForm(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  const Eigen::Matrix3d ca = cofactors(a);
  const Eigen::Matrix3d cb = cofactors(b);
  return { ca.row(0).dot(a.row(0)), ca.cwiseProduct(b).sum(), cb.cwiseProduct(a).sum(), cb.row(0).dot(b.row(0)) };
}

/** The one or three real roots of x^3 + a x^2 + b x + c (Viete's and Cardano's formulas, polished by Newton steps). */
std::vector<double> realRoots(double a, double b, double c)
{
  const double q = (a * a - 3.0 * b) / 9.0;
  const double r = (2.0 * a * a * a - 9.0 * a * b + 27.0 * c) / 54.0;
  std::vector<double> roots;
  if (r * r < q * q * q)
  {
    const double angle = std::acos(std::clamp(r / std::sqrt(q * q * q), -1.0, 1.0));
    for (const double turn : { -2.0 * M_PI, 0.0, 2.0 * M_PI })
    {
      roots.push_back(-2.0 * std::sqrt(q) * std::cos((angle + turn) / 3.0) - a / 3.0);
    }
  }
  else
  {
    const double s = -std::copysign(std::cbrt(std::abs(r) + std::sqrt(std::max(r * r - q * q * q, 0.0))), r);
    roots.push_back(s + (s != 0.0 ? q / s : 0.0) - a / 3.0);
  }
  const auto value = [=](double x) {
    return ((x + a) * x + b) * x + c;
  };
  for (double& x : roots)
  {
    for (int i = 0; i < 3; ++i)
    {
      const double next = x - value(x) / ((3.0 * x + 2.0 * a) * x + b);
      if (!(std::abs(value(next)) < std::abs(value(x))))
      {
        break;
      }
      x = next;
    }
  }
  return roots;
}

using Matrix7x9d = Eigen::Matrix<double, 7, 9, Eigen::RowMajor>;

/**
 * An orthonormal basis of the null space of seven equations, by elimination with complete pivoting, many times quicker
 * than by a QR decomposition; empty when their rank is lower.
 */
std::optional<Eigen::Matrix<double, 9, 2>> nullSpace(Matrix7x9d& equations)
{
  constexpr double RANK_TOLERANCE = 1e-9;
  std::array<int, 9> unknowns{ 0, 1, 2, 3, 4, 5, 6, 7, 8 };  // of the columns
  double largest = 0.0;
  for (int k = 0; k < 7; ++k)
  {
    int row = k;
    int column = k;
    double pivot = -1.0;
    for (int i = k; i < 7; ++i)
    {
      for (int j = k; j < 9; ++j)
      {
        const double size = std::abs(equations(i, j));
        if (size > pivot)
        {
          pivot = size;
          row = i;
          column = j;
        }
      }
    }
    largest = std::max(largest, pivot);
    if (!(pivot > RANK_TOLERANCE * largest))
    {
      return std::nullopt;
    }
    equations.row(k).swap(equations.row(row));
    equations.col(k).swap(equations.col(column));
    std::swap(unknowns[static_cast<std::size_t>(k)], unknowns[static_cast<std::size_t>(column)]);
    for (int i = k + 1; i < 7; ++i)
    {
      const double factor = equations(i, k) / equations(k, k);
      for (int j = k + 1; j < 9; ++j)
      {
        equations(i, j) -= factor * equations(k, j);
      }
    }
  }
  // The last two unknowns are free.
  Eigen::Matrix<double, 9, 2> solved = Eigen::Matrix<double, 9, 2>::Zero();
  solved(7, 0) = 1.0;
  solved(8, 1) = 1.0;
  for (int k = 6; k >= 0; --k)
  {
    Eigen::RowVector2d sum = equations.block<1, 2>(k, 7);
    for (int j = k + 1; j < 7; ++j)
    {
      sum += equations(k, j) * solved.row(j);
    }
    solved.row(k) = -sum / equations(k, k);
  }
  Eigen::Matrix<double, 9, 2> basis;
  for (int k = 0; k < 9; ++k)
  {
    basis.row(unknowns[static_cast<std::size_t>(k)]) = solved.row(k);
  }
  basis.col(0).normalize();
  basis.col(1) -= basis.col(0).dot(basis.col(1)) * basis.col(0);
  basis.col(1).normalize();
  return basis;
}

/** Sampson distance of a set of pairs as a function of the orthonormal representation. */
class FundamentalProblem
{
public:
  using State = Orthonormal;
  static constexpr int DOF = 7;

  FundamentalProblem(Correspondences pairs, double huber_width) : pairs_(std::move(pairs)), huber_width_(huber_width)
  {
  }

  double cost(const State& state) const
  {
    const Eigen::Matrix3d f = state.matrix();
    double sum = 0.0;
    for (const Correspondence& pair : pairs_)
    {
      sum += huberCost(sampsonError(f, pair), huber_width_);
    }
    return sum;
  }

  void linearize(const State& state, Eigen::Matrix<double, 7, 7>& jtj, Vector7d& gradient) const
  {
    const Eigen::Matrix3d f = state.matrix();
    Eigen::Matrix<double, 1, 9> jacobian;
    Matrix9d jtj_entries = Matrix9d::Zero();
    Vector9d gradient_entries = Vector9d::Zero();
    for (const Correspondence& pair : pairs_)
    {
      const double residual = sampsonResidual(f, pair, jacobian);
      const double weight = huberWeight(residual * residual, huber_width_);
      jtj_entries.noalias() += (weight * jacobian).transpose() * jacobian;
      gradient_entries += (weight * residual) * jacobian.transpose();
    }
    const Matrix9x7d derivatives = state.derivatives();
    jtj = derivatives.transpose() * jtj_entries * derivatives;
    gradient = derivatives.transpose() * gradient_entries;
  }

  State moved(const State& state, const Vector7d& step) const
  {
    return state.moved(step);
  }

private:
  Correspondences pairs_;
  double huber_width_;
};

/** Unit null vector of a 3x3 matrix of rank 2: the largest cross product of two of its rows. */
Eigen::Vector3d nullVector(const Eigen::Matrix3d& m)
{
  const Eigen::Matrix3d c = cofactors(m);
  Eigen::Index row = 0;
  c.rowwise().squaredNorm().maxCoeff(&row);
  return c.row(row).transpose().normalized();
}

}  // namespace

double sampsonError(const Eigen::Matrix3d& f, const Correspondence& pair)
{
  // Written out: this is the inner loop of every RANSAC for F.
  const double u = pair.reference.x();
  const double v = pair.reference.y();
  const double u_cur = pair.current.x();
  const double v_cur = pair.current.y();
  const double line_u = f(0, 0) * u + f(0, 1) * v + f(0, 2);
  const double line_v = f(1, 0) * u + f(1, 1) * v + f(1, 2);
  const double line_w = f(2, 0) * u + f(2, 1) * v + f(2, 2);
  const double back_u = f(0, 0) * u_cur + f(1, 0) * v_cur + f(2, 0);
  const double back_v = f(0, 1) * u_cur + f(1, 1) * v_cur + f(2, 1);
  const double algebraic = u_cur * line_u + v_cur * line_v + line_w;
  const double error = algebraic * algebraic / (line_u * line_u + line_v * line_v + back_u * back_u + back_v * back_v);
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : error;  // where both points are epipoles
}

std::vector<Eigen::Matrix3d> fundamentalFromSevenPoints(const Correspondences& seven)
{
  if (seven.size() != 7)
  {
    return {};
  }
  const auto normalization = isotropicNormalization(seven);
  if (!normalization)
  {
    return {};
  }
  // The equations (x_cur (x) x_ref)^T f = 0.
  Matrix7x9d equations;
  for (int i = 0; i < 7; ++i)
  {
    const auto [reference, current] = (*normalization)(seven[i]);
    equations.row(i) << current.x() * reference.homogeneous().transpose(),
        current.y() * reference.homogeneous().transpose(), reference.homogeneous().transpose();
  }
  const auto kernel = nullSpace(equations);
  if (!kernel)
  {
    return {};
  }
  const Eigen::Matrix3d f1 = matrixFromRows(kernel->col(0));
  const Eigen::Matrix3d f2 = matrixFromRows(kernel->col(1));

  // The pencil is searched as x a + b, with a the least singular of four directions in it: a cubic form vanishes in
  // three at most, so that no solution lies at or near x = infinity (as F1 - F2 would, in the form of eq. 2.14).
  const std::array<double, 4> form = determinantForm(f1, f2);
  double best = 0.0;
  double c = 1.0;
  double s = 0.0;
  for (int i = 0; i < 4; ++i)
  {
    const double x = std::cos(i * M_PI / 4.0);
    const double y = std::sin(i * M_PI / 4.0);
    const double det = ((form[0] * x + form[1] * y) * x + form[2] * y * y) * x + form[3] * y * y * y;
    if (std::abs(det) > best)
    {
      best = std::abs(det);
      c = x;
      s = y;
    }
  }
  constexpr double ALL_SINGULAR = 1e-14;
  if (!(best > ALL_SINGULAR))
  {
    return {};
  }
  const Eigen::Matrix3d a = c * f1 + s * f2;
  const Eigen::Matrix3d b = c * f2 - s * f1;
  const std::array<double, 4> cubic = determinantForm(a, b);
  std::vector<Eigen::Matrix3d> solutions;
  for (const double x : realRoots(cubic[1] / cubic[0], cubic[2] / cubic[0], cubic[3] / cubic[0]))
  {
    solutions.push_back(denormalized(x * a + b, *normalization));
  }
  return solutions;
}

std::optional<Eigen::Matrix3d> fundamentalFromPoints(const Correspondences& pairs)
{
  const auto solution = solveLinearly(pairs, 8, [](const Correspondence& pair, Matrix9d& ata) {
    const Eigen::Vector3d reference = pair.reference.homogeneous();
    const Eigen::Vector3d current = pair.current.homogeneous();
    addKronecker(current * current.transpose(), reference * reference.transpose(), ata);
  });
  if (!solution)
  {
    return std::nullopt;
  }
  Svd3 svd = singularValues(solution->matrix);
  svd.values.z() = 0.0;
  return denormalized(svd.u * svd.values.asDiagonal() * svd.v.transpose(), solution->normalization);
}

Eigen::Matrix3d refineFundamental(const Eigen::Matrix3d& initial, const Correspondences& pairs, double huber_width,
                                  int max_iterations)
{
  auto usable = refinablePairs(pairs, 7, [&](const Correspondence& pair) { return sampsonError(initial, pair); });
  if (!usable)
  {
    return initial;
  }
  const auto& [reference, current] = usable->normalization;
  const FundamentalProblem problem(std::move(usable->pairs), huber_width * current.scale);
  Orthonormal f(current.inverseMatrix().transpose() * initial * reference.inverseMatrix());
  return levenbergMarquardt(problem, f, max_iterations) ? denormalized(f.matrix(), usable->normalization) : initial;
}

Eigen::Vector3d currentEpipole(const Eigen::Matrix3d& f)
{
  return nullVector(f.transpose());
}

Eigen::Vector3d referenceEpipole(const Eigen::Matrix3d& f)
{
  return nullVector(f);
}

Eigen::Vector2d epipolePixel(const Eigen::Vector3d& epipole)
{
  constexpr double FARTHEST = 1e6;  // [px]
  const Eigen::Vector2d at = epipole.hnormalized();
  const bool is_near = at.norm() < FARTHEST;  // false for NaN
  return is_near ? at : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace view_servo
