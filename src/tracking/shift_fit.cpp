// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "shift_fit.h"

#include "view_servo/geometry/homography.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace view_servo
{
Eigen::Matrix<double, 2, 8> shiftByChange(const Eigen::Vector2d& x)
{
  Eigen::Matrix<double, 2, 8> jacobian;
  jacobian << x.x(), x.y(), 1.0, 0.0, 0.0, 0.0, -x.x() * x.x(), -x.x() * x.y(),  //
      0.0, 0.0, 0.0, x.x(), x.y(), 1.0, -x.x() * x.y(), -x.y() * x.y();
  return jacobian;
}

std::optional<Eigen::Matrix3d> solveChange(const Matrix8& normal, const Vector8& right, const Centring& centring)
{
  const Eigen::LDLT<Matrix8> ldlt(normal);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0))
  {
    return std::nullopt;
  }
  const Vector8 step = ldlt.solve(right);
  Eigen::Matrix3d change;
  change << 1.0 + step(0), step(1), step(2), step(3), 1.0 + step(4), step(5), step(6), step(7), 1.0;
  Eigen::Matrix3d centre;
  centre << 1.0 / centring.spread, 0.0, -centring.middle.x() / centring.spread, 0.0, 1.0 / centring.spread,
      -centring.middle.y() / centring.spread, 0.0, 0.0, 1.0;
  return Eigen::Matrix3d(centre.inverse() * change * centre);
}

void ShiftFit::add(const Eigen::Vector2d& at, const Eigen::Vector2d& shift, const Eigen::Matrix2d& information)
{
  shifts_.push_back({ at, shift, information });
}

/** About the shifts' places; empty when these are one. */
std::optional<Centring> ShiftFit::centring() const
{
  Centring result;
  for (const Shift& shift : shifts_)
  {
    result.middle += shift.at / static_cast<double>(shifts_.size());
  }
  result.spread = 0.0;
  for (const Shift& shift : shifts_)
  {
    result.spread += (shift.at - result.middle).norm() / static_cast<double>(shifts_.size());
  }
  return result.spread > 0.0 ? std::optional<Centring>(result) : std::nullopt;
}

std::optional<Eigen::Matrix3d> ShiftFit::solve() const
{
  constexpr int ROUNDS = 4;
  Eigen::Matrix3d fitted = Eigen::Matrix3d::Identity();
  const std::optional<Centring> centred = centring();
  if (!centred)
  {
    return std::nullopt;
  }
  for (int round = 0; round < ROUNDS; ++round)
  {
    Matrix8 normal = Matrix8::Zero();
    Vector8 right = Vector8::Zero();
    for (const Shift& shift : shifts_)
    {
      const Eigen::Vector2d residual = shift.shift + shift.at - transfer(fitted, shift.at);
      const double ratio = residual.squaredNorm() / (width_ * width_);
      if (!(ratio < 1.0))
      {
        continue;
      }
      const double weight = (1.0 - ratio) * (1.0 - ratio);
      const Eigen::Vector2d x = centred->apply(shift.at);
      const Eigen::Matrix<double, 2, 8> jacobian = shiftByChange(x);
      const Eigen::Matrix<double, 8, 2> weighted = weight * jacobian.transpose() * shift.information;
      normal += weighted * jacobian;
      right += weighted * residual / centred->spread;
    }
    const std::optional<Eigen::Matrix3d> change = solveChange(normal, right, *centred);
    if (!change)
    {
      return std::nullopt;
    }
    fitted = *change * fitted;
  }
  return fitted;
}

Points ShiftFit::supporting(const Eigen::Matrix3d& fitted, double max_residual, double& rms) const
{
  Points points;
  double squares = 0.0;
  for (const Shift& shift : shifts_)
  {
    const double squared = (shift.shift + shift.at - transfer(fitted, shift.at)).squaredNorm();
    if (squared <= max_residual * max_residual)
    {
      points.push_back(shift.at);
      squares += squared;
    }
  }
  rms = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(points.size(), 1)));
  return points;
}

}  // namespace view_servo
