// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/line_planes.h"

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/line_homography_estimator.h"

#include <Eigen/LU>

#include <algorithm>
#include <cstddef>

namespace view_servo
{
namespace
{
}  // namespace

std::vector<Parameter> parameters(LinePlaneParams& params)
{
  return {
    real("plane_threshold", params.threshold, "px", "> 0", "largest error of a line on a plane, across"),
    integer("min_plane_lines", params.min_lines, "", ">= 5", "lines that make a plane"),
    integer("max_planes", params.max_planes, "", ">= 1", "planes looked for"),
  };
}

std::vector<std::string> LinePlaneParams::validate() const
{
  return faultsOf(*this);
}

LinePlanes findPlanes(const SegmentPairs& lines, const LinePlaneParams& params, const RansacParams& ransac_params,
                      Rng& rng)
{
  LinePlanes planes{ {}, std::vector<int>(lines.size(), -1) };
  RansacParams plane_params = ransac_params;
  plane_params.inlier_threshold = params.threshold;
  plane_params.sampling = Sampling::UNIFORM;
  plane_params.max_iterations = std::min(plane_params.max_iterations, 500);  // enough for a third of the lines
  std::vector<int> left(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i)
  {
    left[i] = static_cast<int>(i);
  }
  while (static_cast<int>(planes.homographies.size()) < params.max_planes &&
         static_cast<int>(left.size()) >= params.min_lines)
  {
    SegmentPairs remaining;
    for (const int i : left)
    {
      remaining.push_back(lines[static_cast<std::size_t>(i)]);
    }
    const auto found = ransac(LineHomographyEstimator(remaining), plane_params, rng);
    if (!found.model || static_cast<int>(found.inliers.size()) < params.min_lines)
    {
      break;
    }
    for (const int i : found.inliers)
    {
      planes.of_line[static_cast<std::size_t>(left[static_cast<std::size_t>(i)])] =
          static_cast<int>(planes.homographies.size());
    }
    planes.homographies.push_back(found.model->h);
    left.erase(std::remove_if(left.begin(), left.end(),
                              [&](int i) { return planes.of_line[static_cast<std::size_t>(i)] >= 0; }),
               left.end());
  }
  return planes;
}

bool liesOnPlane(const LinePlanes& planes, const Correspondence& point, double threshold)
{
  return std::any_of(planes.homographies.begin(), planes.homographies.end(), [&](const Eigen::Matrix3d& h) {
    return 0.5 * symmetricTransferError(h, h.inverse(), point) <= threshold * threshold;
  });
}

std::optional<Eigen::Matrix3d> fundamentalOfPoints(const Correspondences& points, const RansacParams& params, Rng& rng)
{
  constexpr std::size_t MIN_POINTS = 12;
  if (points.size() < MIN_POINTS)
  {
    return std::nullopt;
  }
  RansacParams ransac_params = params;
  ransac_params.sampling = Sampling::UNIFORM;
  const auto found = ransac(FundamentalEstimator(points, 0.0), ransac_params, rng);
  if (!found.model || found.inliers.size() < MIN_POINTS)
  {
    return std::nullopt;
  }
  return polishFundamental(*found.model, select(points, found.inliers), FIT_HUBER_WIDTH);
}

std::optional<Eigen::Matrix3d> fundamentalOfPlanes(const SegmentPairs& lines, const LinePlanes& planes)
{
  if (planes.homographies.size() < 2)
  {
    return std::nullopt;
  }
  Correspondences sent;
  for (std::size_t i = 0; i < lines.size(); ++i)
  {
    if (planes.of_line[i] == 0 || planes.of_line[i] == 1)
    {
      const Eigen::Matrix3d& h = planes.homographies[static_cast<std::size_t>(planes.of_line[i])];
      for (const Eigen::Vector2d& end : { lines[i].reference.start, lines[i].reference.end })
      {
        sent.push_back({ end, transfer(h, end) });
      }
    }
  }
  const auto linear = fundamentalFromPoints(sent);
  return linear ? std::optional<Eigen::Matrix3d>(refineFundamental(*linear, sent, FIT_HUBER_WIDTH)) : std::nullopt;
}

}  // namespace view_servo
