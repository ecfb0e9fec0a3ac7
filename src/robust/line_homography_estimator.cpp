// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/line_homography_estimator.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>

namespace view_servo
{
namespace
{
/** Line through a segment, homogeneous, in coordinates about `origin` and in units of `scale` [px]; unit normal. */
Eigen::Vector3d lineOf(const Segment& segment, const Eigen::Vector2d& origin, double scale)
{
  const Eigen::Vector2d n = segment.normal();
  return { n.x(), n.y(), -n.dot(segment.midpoint() - origin) / scale };
}

/** Whether some three of four lines are nearly parallel, or meet nearly in a point. */
template <typename Member>
bool isDegenerate(const SegmentPairs& pairs, const std::vector<int>& sample, Member member)
{
  constexpr double MIN_VOLUME = 0.02;  // of three lines' unit normals and offsets, about the segments' extent
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const int i : sample)
  {
    mean += (pairs[static_cast<std::size_t>(i)].*member).midpoint() / 4.0;
  }
  double extent = 0.0;
  for (const int i : sample)
  {
    const Segment& segment = pairs[static_cast<std::size_t>(i)].*member;
    extent += ((segment.start - mean).norm() + (segment.end - mean).norm()) / 8.0;
  }
  Eigen::Matrix<double, 3, 4> lines;
  for (int k = 0; k < 4; ++k)
  {
    lines.col(k) = lineOf(pairs[static_cast<std::size_t>(sample[static_cast<std::size_t>(k)])].*member, mean, extent);
  }
  for (int skipped = 0; skipped < 4; ++skipped)
  {
    Eigen::Matrix3d three;
    for (int k = 0, column = 0; k < 4; ++k)
    {
      if (k != skipped)
      {
        three.col(column++) = lines.col(k);
      }
    }
    if (!(std::abs(three.determinant()) > MIN_VOLUME))
    {
      return true;
    }
  }
  return false;
}

std::optional<LineHomographyEstimator::Model> toModel(const std::optional<Eigen::Matrix3d>& h)
{
  if (!h)
  {
    return std::nullopt;
  }
  const Eigen::Matrix3d inverse = h->inverse();
  return inverse.allFinite() ? std::optional<LineHomographyEstimator::Model>({ *h, inverse }) : std::nullopt;
}

}  // namespace

bool LineHomographyEstimator::accepts(const std::vector<int>& sample) const
{
  return !isDegenerate(pairs_, sample, &SegmentPair::reference) && !isDegenerate(pairs_, sample, &SegmentPair::current);
}

void LineHomographyEstimator::solve(const std::vector<int>& sample, std::vector<Model>& models) const
{
  SegmentPairs pairs;
  for (const int i : sample)
  {
    pairs.push_back(pairs_[static_cast<std::size_t>(i)]);
  }
  if (const auto model = toModel(homographyFromLines(pairs)))
  {
    models.push_back(*model);
  }
}

double LineHomographyEstimator::error(const Model& model, std::size_t i) const
{
  constexpr double INFINITE = std::numeric_limits<double>::infinity();
  constexpr double MIN_COSINE = 0.97;
  const SegmentPair& pair = pairs_[i];
  const auto forward = transfer(model.h, pair.reference);
  // The inverse has an arbitrary scale; give it depth 1 where the current segment is.
  const Eigen::Matrix3d& inverse = model.h_inverse;
  const double depth = inverse.row(2).dot(pair.current.midpoint().homogeneous());
  const auto backward = transfer(inverse / depth, pair.current);
  if (!forward || !backward)
  {
    return INFINITE;
  }
  const SegmentAgreement in_current = compare(*forward, pair.current);
  const SegmentAgreement in_reference = compare(*backward, pair.reference);
  if (in_current.cosine < MIN_COSINE || in_reference.cosine < MIN_COSINE)
  {
    return INFINITE;
  }
  return 0.5 * (in_current.distance * in_current.distance + in_reference.distance * in_reference.distance);
}

std::optional<LineHomographyEstimator::Model> LineHomographyEstimator::refit(const Model& /*model*/,
                                                                             const std::vector<int>& inliers) const
{
  SegmentPairs pairs;
  for (const int i : inliers)
  {
    pairs.push_back(pairs_[static_cast<std::size_t>(i)]);
  }
  return toModel(homographyFromLines(pairs));
}

}  // namespace view_servo
