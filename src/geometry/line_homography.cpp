// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/line_homography.h"

#include "decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
using Row = Eigen::Matrix<double, 1, 9>;

/** Similarity that moves the midpoints' mean to the origin and scales the segments' mean extent to about sqrt(2). */
template <typename Member>
Eigen::Matrix3d normalization(const SegmentPairs& pairs, Member member)
{
  const double n = static_cast<double>(pairs.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const SegmentPair& pair : pairs)
  {
    mean += (pair.*member).midpoint() / n;
  }
  double extent = 0.0;
  for (const SegmentPair& pair : pairs)
  {
    extent += (((pair.*member).start - mean).norm() + ((pair.*member).end - mean).norm()) / (2.0 * n);
  }
  const double scale = std::sqrt(2.0) / extent;
  Eigen::Matrix3d t;
  t << scale, 0.0, -scale * mean.x(), 0.0, scale, -scale * mean.y(), 0.0, 0.0, 1.0;
  return t;
}

/** Sum over all end points of rowᵀ row, where row · vec(H) = l_curᵀ H x_ref (H row by row, normalised coordinates). */
Matrix9d normalMatrix(const SegmentPairs& pairs, const Eigen::Matrix3d& from, const Eigen::Matrix3d& to)
{
  Matrix9d sum = Matrix9d::Zero();
  for (const SegmentPair& pair : pairs)
  {
    const Eigen::Vector2d normal = pair.current.normal();
    const Eigen::Vector2d on_line = (to * pair.current.midpoint().homogeneous()).hnormalized();
    const Eigen::Vector3d line(normal.x(), normal.y(), -normal.dot(on_line));
    for (const Eigen::Vector2d& end : { pair.reference.start, pair.reference.end })
    {
      const Eigen::RowVector3d x = (from * end.homogeneous()).transpose();
      Row row;
      row << line.x() * x, line.y() * x, line.z() * x;
      sum.selfadjointView<Eigen::Upper>().rankUpdate(row.transpose());
    }
  }
  return sum.selfadjointView<Eigen::Upper>();
}

/** Undoes the normalisation; third coordinate 1 at its origin, the mean of the reference. */
std::optional<Eigen::Matrix3d> denormalized(const Eigen::Matrix3d& h, const Eigen::Matrix3d& from,
                                            const Eigen::Matrix3d& to)
{
  const Eigen::Matrix3d scaled = to.inverse() * (h / h(2, 2)) * from;
  return scaled.allFinite() ? std::optional<Eigen::Matrix3d>(scaled) : std::nullopt;
}

constexpr double RANK_TOLERANCE = 1e-10;  // of eigenvalues: squares of normalised distances

}  // namespace

std::optional<Eigen::Matrix3d> homographyFromLines(const SegmentPairs& pairs)
{
  if (pairs.size() < 4)
  {
    return std::nullopt;
  }
  const Eigen::Matrix3d from = normalization(pairs, &SegmentPair::reference);
  const Eigen::Matrix3d to = normalization(pairs, &SegmentPair::current);
  const SymmetricEigen eigen = symmetricEigen(normalMatrix(pairs, from, to));
  if (!(eigen.values(1) > RANK_TOLERANCE * eigen.values(8)))
  {
    return std::nullopt;
  }
  return denormalized(matrixFromRows(eigen.vectors.col(0)), from, to);
}

std::optional<Eigen::Matrix3d> affinityFromLines(const SegmentPairs& pairs)
{
  if (pairs.size() < 3)
  {
    return std::nullopt;
  }
  const Eigen::Matrix3d from = normalization(pairs, &SegmentPair::reference);
  const Eigen::Matrix3d to = normalization(pairs, &SegmentPair::current);
  const Matrix9d sum = normalMatrix(pairs, from, to);
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factors(sum.topLeftCorner<6, 6>());
  if (!(factors.vectorD().minCoeff() > RANK_TOLERANCE * factors.vectorD().maxCoeff()))
  {
    return std::nullopt;
  }
  Eigen::Matrix<double, 9, 1> values;
  values << factors.solve(-sum.topRightCorner<6, 1>()), 0.0, 0.0, 1.0;
  return denormalized(matrixFromRows(values), from, to);
}

std::optional<Eigen::Matrix3d> plausibleAffinity(const Eigen::Vector2d* from, const Eigen::Vector2d* to,
                                                 const double* weights, int n, const AffinityLimits& limits)
{
  Eigen::Vector2d mean_from = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_to = Eigen::Vector2d::Zero();
  double sum = 0.0;
  for (int i = 0; i < n; ++i)
  {
    mean_from += weights[i] * from[i];
    mean_to += weights[i] * to[i];
    sum += weights[i];
  }
  mean_from /= sum;
  mean_to /= sum;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d mixed = Eigen::Matrix2d::Zero();
  for (int i = 0; i < n; ++i)
  {
    spread += weights[i] * (from[i] - mean_from) * (from[i] - mean_from).transpose();
    mixed += weights[i] * (to[i] - mean_to) * (from[i] - mean_from).transpose();
  }
  constexpr double FLAT = 1e-3;  // of the squared trace
  if (!(spread.determinant() > FLAT * spread.trace() * spread.trace()))
  {
    return std::nullopt;
  }
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() = mixed * spread.inverse();
  map.topRightCorner<2, 1>() = mean_to - map.topLeftCorner<2, 2>() * mean_from;
  const double determinant = map.topLeftCorner<2, 2>().determinant();
  // (s1² + s2²) / (s1 s2), about s1 / s2 when they differ.
  const double anisotropy = map.topLeftCorner<2, 2>().squaredNorm() / determinant;
  if (!(determinant > 1.0 / (limits.scale_change * limits.scale_change) &&
        determinant < limits.scale_change * limits.scale_change && anisotropy < limits.anisotropy))
  {
    return std::nullopt;
  }
  return map;
}

std::optional<Segment> transfer(const Eigen::Matrix3d& h, const Segment& segment)
{
  constexpr double MIN_DEPTH = 0.1;
  const Eigen::Vector3d start = h * segment.start.homogeneous();
  const Eigen::Vector3d end = h * segment.end.homogeneous();
  if (!(start.z() > MIN_DEPTH && end.z() > MIN_DEPTH))
  {
    return std::nullopt;
  }
  return Segment{ start.hnormalized(), end.hnormalized() };
}

SegmentAgreement compare(const Segment& a, const Segment& b)
{
  const double length_a = a.length();
  const double length_b = b.length();
  const Eigen::Vector2d direction = (b.end - b.start) / length_b;
  const Eigen::Vector2d normal(-direction.y(), direction.x());
  const Eigen::Vector2d from = a.start - b.start;
  const Eigen::Vector2d to = a.end - b.start;
  // Along and across b.
  const double start = from.dot(direction);
  const double end = to.dot(direction);
  const double first = std::max(0.0, std::min(start, end));
  const double last = std::min(length_b, std::max(start, end));
  const double cosine = (end - start) / length_a;
  if (!(last > first))
  {
    return { std::numeric_limits<double>::infinity(), cosine, 0.0, 0.0 };
  }
  const double across = from.dot(normal);
  const double slope = (to.dot(normal) - across) / (end - start);
  const double distance =
      std::max(std::abs(across + slope * (first - start)), std::abs(across + slope * (last - start)));
  const double covered = std::max(length_b, std::max(start, end)) - std::min(0.0, std::min(start, end));
  return { distance, cosine, std::min(1.0, (last - first) / std::min(length_a, length_b)), (last - first) / covered };
}

}  // namespace view_servo
