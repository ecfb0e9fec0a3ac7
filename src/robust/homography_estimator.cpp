// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/homography_estimator.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace view_servo
{
namespace
{
/** Four points as a projective basis: the matrix (a, b, c) and the coordinates of d in it. */
struct Basis
{
  Eigen::Matrix3d matrix;
  Eigen::Matrix3d inverse;
  Eigen::Vector3d fourth;

  Basis(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c, const Eigen::Vector2d& d)
  {
    matrix << a.homogeneous(), b.homogeneous(), c.homogeneous();
    inverse = matrix.inverse();
    fourth = inverse * d.homogeneous();
  }
};

}  // namespace

bool HomographyEstimator::accepts(const std::vector<int>& sample) const
{
  return isHomographySample(select(pairs_, sample));
}

void HomographyEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  // In closed form: H takes the one basis to the other, H = B_cur diag(fourth_cur / fourth_ref) B_ref^-1. The factors
  // are the third coordinates of the first three points, that of the fourth is 1: all must be positive.
  const Correspondence& a = pairs_[sample[0]];
  const Correspondence& b = pairs_[sample[1]];
  const Correspondence& c = pairs_[sample[2]];
  const Correspondence& d = pairs_[sample[3]];
  const Basis reference(a.reference, b.reference, c.reference, d.reference);
  const Basis current(a.current, b.current, c.current, d.current);
  const Eigen::Vector3d factors = current.fourth.cwiseQuotient(reference.fourth);
  if (!factors.allFinite() || !(factors.minCoeff() > 0.0))
  {
    return;
  }
  const Eigen::Matrix3d h = (current.matrix * factors.asDiagonal() * reference.inverse).normalized();
  const Eigen::Matrix3d h_inverse = h.inverse();
  if (h.allFinite() && h_inverse.allFinite())
  {
    models.push_back({ h, h_inverse });
  }
}

double HomographyEstimator::error(const Model& model, std::size_t i) const
{
  return 0.5 * symmetricTransferError(model.h, model.h_inverse, pairs_[i]);
}

std::optional<HomographyEstimator::Model> HomographyEstimator::refit(const Model& /*model*/,
                                                                     const std::vector<int>& inliers) const
{
  constexpr int ITERATIONS = 3;  // from the linear estimate: the cost is flat to 1e-4 after two or three
  const Correspondences pairs = select(pairs_, inliers);
  const auto linear = homographyFromPoints(pairs);
  if (!linear)
  {
    return std::nullopt;
  }
  const Eigen::Matrix3d h = refineHomography(*linear, pairs, std::numeric_limits<double>::infinity(), ITERATIONS);
  return Model{ h, h.inverse() };
}

}  // namespace view_servo
