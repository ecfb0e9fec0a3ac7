// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/homography.h"

#include "levenberg_marquardt.h"
#include "linear_estimate.h"
#include "normalization.h"
#include "residuals.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double INFINITE = std::numeric_limits<double>::infinity();

/** Third coordinate of H x. */
double thirdCoordinate(const Eigen::Matrix3d& h, const Eigen::Vector2d& p)
{
  return h(2, 0) * p.x() + h(2, 1) * p.y() + h(2, 2);
}

/** |H p - q|^2, or infinity. Written out: this is the inner loop of every homography RANSAC. */
double squaredTransferError(const Eigen::Matrix3d& h, const Eigen::Vector2d& p, const Eigen::Vector2d& q)
{
  const double w = thirdCoordinate(h, p);
  if (!(w > 0.0))
  {
    return INFINITE;
  }
  const double scale = 1.0 / w;
  const double du = (h(0, 0) * p.x() + h(0, 1) * p.y() + h(0, 2)) * scale - q.x();
  const double dv = (h(1, 0) * p.x() + h(1, 1) * p.y() + h(1, 2)) * scale - q.y();
  return du * du + dv * dv;
}

/** Twice the signed area of a triangle over its longest side: its smallest height, signed by its orientation. */
double signedHeight(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c)
{
  const Eigen::Vector2d ab = b - a;
  const Eigen::Vector2d ac = c - a;
  const double longest = std::sqrt(std::max({ ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm() }));
  return (ab.x() * ac.y() - ab.y() * ac.x()) / longest;  // NaN for three coincident points
}

/** Symmetric transfer error of a set of pairs as a function of the nine entries of H, whose norm is held at one. */
class HomographyProblem
{
public:
  using State = Eigen::Matrix3d;
  static constexpr int DOF = 9;

  HomographyProblem(Correspondences pairs, double huber_width) : pairs_(std::move(pairs)), huber_width_(huber_width)
  {
  }

  double cost(const State& h) const
  {
    const Eigen::Matrix3d h_inverse = h.inverse();
    double sum = 0.0;
    for (const Correspondence& pair : pairs_)
    {
      sum += huberCost(symmetricTransferError(h, h_inverse, pair), huber_width_);
    }
    return sum;
  }

  void linearize(const State& h, Matrix9d& jtj, Vector9d& gradient) const
  {
    const Eigen::Matrix3d h_inverse = h.inverse();
    Matrix9d lower = Matrix9d::Zero();
    Eigen::Matrix3d gradient_matrix = Eigen::Matrix3d::Zero();
    for (const Correspondence& pair : pairs_)
    {
      const TransferResidual forward = forwardResidual(h, pair);
      const TransferResidual backward = backwardResidual(h_inverse, pair);
      const double squared_error = forward.residual.squaredNorm() + backward.residual.squaredNorm();
      const double weight = huberWeight(squared_error, huber_width_);
      for (const TransferResidual* side : { &forward, &backward })
      {
        const Eigen::Matrix<double, 3, 2> weighted = weight * side->derivative.transpose();
        addKronecker(weighted * side->derivative, side->point * side->point.transpose(), lower);
        gradient_matrix += (weighted * side->residual) * side->point.transpose();
      }
    }
    jtj = symmetric(lower);
    gradient = rowMajor(gradient_matrix);
    // No residual depends on the scale of H: hold it, so that the equations are regular.
    const Vector9d scale_direction = rowMajor(h);
    jtj += (jtj.trace() / DOF) * scale_direction * scale_direction.transpose();
  }

  State moved(const State& h, const Vector9d& step) const
  {
    return (h + matrixFromRows(step)).normalized();
  }

private:
  Correspondences pairs_;
  double huber_width_;
};

}  // namespace

Eigen::Matrix3d normalizedHomography(const Eigen::Matrix3d& h)
{
  constexpr double NEARLY_ZERO = 1e-12;
  const double norm = h.norm();
  return std::abs(h(2, 2)) > NEARLY_ZERO * norm ? h / std::abs(h(2, 2)) : h / norm;
}

Eigen::Vector2d transfer(const Eigen::Matrix3d& h, const Eigen::Vector2d& point)
{
  const Eigen::Vector3d x = h * point.homogeneous();
  if (!(x.z() > 0.0))
  {
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return x.hnormalized();
}

double symmetricTransferError(const Eigen::Matrix3d& h, const Eigen::Matrix3d& h_inverse, const Correspondence& pair)
{
  const double error = squaredTransferError(h, pair.reference, pair.current) +
                       squaredTransferError(h_inverse, pair.current, pair.reference);
  return std::isnan(error) ? INFINITE : error;
}

bool isHomographySample(const Correspondences& four, double min_height)
{
  constexpr int TRIANGLES[4][3] = { { 0, 1, 2 }, { 0, 1, 3 }, { 0, 2, 3 }, { 1, 2, 3 } };
  if (four.size() != 4)
  {
    return false;
  }
  return std::all_of(std::begin(TRIANGLES), std::end(TRIANGLES), [&](const auto& triangle) {
    const Correspondence& a = four[triangle[0]];
    const Correspondence& b = four[triangle[1]];
    const Correspondence& c = four[triangle[2]];
    const double reference = signedHeight(a.reference, b.reference, c.reference);
    const double current = signedHeight(a.current, b.current, c.current);
    return std::abs(reference) >= min_height && std::abs(current) >= min_height && reference * current > 0.0;
  });
}

std::optional<Eigen::Matrix3d> homographyFromPoints(const Correspondences& pairs)
{
  constexpr double SINGULAR = 1e-12;  // the determinant of a matrix whose squared entries add up to 1
  const auto solution = solveLinearly(pairs, 4, [](const Correspondence& pair, Matrix9d& ata) {
    // The rows (x^T, 0, -u' x^T) and (0, x^T, -v' x^T) of a pair add M (x) x x^T to A^T A.
    const auto& [reference, current] = pair;
    Eigen::Matrix3d m;
    m << 1.0, 0.0, -current.x(), 0.0, 1.0, -current.y(), -current.x(), -current.y(), current.squaredNorm();
    const Eigen::Vector3d x = reference.homogeneous();
    addKronecker(m, x * x.transpose(), ata);
  });
  if (!solution || !(std::abs(solution->matrix.determinant()) > SINGULAR))
  {
    return std::nullopt;
  }
  const auto& [normalized, normalization] = *solution;
  Eigen::Matrix3d h =
      (normalization.current.inverseMatrix() * normalized * normalization.reference.matrix()).normalized();
  if (thirdCoordinate(h, pairs.front().reference) < 0.0)
  {
    h = -h;
  }
  const Eigen::Matrix3d h_inverse = h.inverse();
  const bool in_view = std::all_of(pairs.begin(), pairs.end(), [&](const Correspondence& pair) {
    return std::isfinite(symmetricTransferError(h, h_inverse, pair));
  });
  return in_view ? std::make_optional(h) : std::nullopt;
}

Eigen::Matrix3d refineHomography(const Eigen::Matrix3d& initial, const Correspondences& pairs, double huber_width,
                                 int max_iterations)
{
  const Eigen::Matrix3d initial_inverse = initial.inverse();
  auto usable = refinablePairs(
      pairs, 4, [&](const Correspondence& pair) { return symmetricTransferError(initial, initial_inverse, pair); });
  if (!usable)
  {
    return initial;
  }
  const auto& [reference, current] = usable->normalization;
  const HomographyProblem problem(std::move(usable->pairs), huber_width * current.scale);
  Eigen::Matrix3d h = (current.matrix() * initial * reference.inverseMatrix()).normalized();
  if (!levenbergMarquardt(problem, h, max_iterations))
  {
    return initial;
  }
  return (current.inverseMatrix() * h * reference.matrix()).normalized();
}

}  // namespace view_servo
