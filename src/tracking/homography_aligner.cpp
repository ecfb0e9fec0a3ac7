// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/homography_aligner.h"

#include "patch.h"
#include "region_refiner.h"
#include "shift_fit.h"
#include "view_servo/features/corners.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/** Levels of half the size each, the image itself first. */
std::vector<cv::Mat> pyramidOf(const cv::Mat& image, int levels)
{
  constexpr int LEAST_SIDE = 40;  // [px]
  std::vector<cv::Mat> pyramid{ image };
  while (static_cast<int>(pyramid.size()) < levels &&
         std::min(pyramid.back().rows, pyramid.back().cols) >= 2 * LEAST_SIDE)
  {
    cv::Mat next;
    cv::pyrDown(pyramid.back(), next);
    pyramid.push_back(next);
  }
  return pyramid;
}

/** cv::pyrDown() takes every second pixel, from the first. */
Eigen::Matrix3d toLevel(int level)
{
  const double scale = std::ldexp(1.0, -level);
  return Eigen::Vector3d(scale, scale, 1.0).asDiagonal();
}

/** RANSAC; empty when too few agree. */
std::optional<Eigen::Matrix3d> mostAgreed(const Correspondences& pairs, const HomographyAlignerParams& params)
{
  RansacParams ransac_params;
  ransac_params.inlier_threshold = params.max_residual;
  ransac_params.sampling = Sampling::UNIFORM;
  ransac_params.min_iterations = 20;
  ransac_params.max_iterations = 500;
  ransac_params.local_optimizations = 2;
  Rng rng(1);
  const auto found = ransac(HomographyEstimator(pairs), ransac_params, rng);
  if (!found.model || static_cast<int>(found.inliers.size()) < params.min_supporting)
  {
    return std::nullopt;
  }
  return found.model->h;
}

/** The region, or the whole view when that is empty. @throws std::invalid_argument when something cannot be used. */
cv::Rect checkedRegion(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
{
  requireNoFaults("parameters of the homography aligner", params.validate());
  if (reference.empty() || reference.type() != CV_8UC1)
  {
    throw std::invalid_argument("the stored view is not an 8-bit grey image");
  }
  const cv::Rect all(0, 0, reference.cols, reference.rows);
  const cv::Rect used = region.empty() ? all : region;
  if ((used & all) != used)
  {
    throw std::invalid_argument("the region of interest leaves the stored view");
  }
  return used;
}

/** The corners of a region [px], strongest first. @throws std::invalid_argument when they are too few. */
Points findCorners(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
{
  constexpr double SPREAD = 0.5;  // of the distance that corners on a grid would have
  cv::Mat mask(reference.size(), CV_8UC1, cv::Scalar(0));
  mask(region).setTo(255);
  CornerParams corners;
  corners.max_corners = params.max_points;
  corners.min_distance = SPREAD * std::sqrt(static_cast<double>(region.area()) / params.max_points);
  corners.border = params.patch_radius + 2;
  Points points;
  for (const Corner& corner : detectCorners(reference, corners, mask))
  {
    points.push_back(corner.position);
  }
  if (static_cast<int>(points.size()) < params.min_supporting)
  {
    throw std::invalid_argument("the stored view has " + std::to_string(points.size()) + " corners to track, " +
                                std::to_string(params.min_supporting) + " are needed");
  }
  return points;
}

/** The patches of all levels, of all points. */
std::vector<std::vector<Patch>> patchesOf(const cv::Mat& reference, const Points& points,
                                          const HomographyAlignerParams& params)
{
  constexpr int COARSE_RADIUS = 6;  // [px]
  std::vector<std::vector<Patch>> patches;
  const std::vector<cv::Mat> pyramid = pyramidOf(reference, params.levels);
  for (std::size_t level = 0; level < pyramid.size(); ++level)
  {
    const double scale = std::ldexp(1.0, -static_cast<int>(level));
    const int radius = level == 0 ? params.patch_radius : std::min(params.patch_radius, COARSE_RADIUS);
    std::vector<Patch> of_level;
    for (const Eigen::Vector2d& point : points)
    {
      of_level.push_back(makePatch(pyramid[level], scale * point, radius));
    }
    patches.push_back(std::move(of_level));
  }
  return patches;
}

/** A corner whose patch was found again, in one level of the pyramids. */
struct FoundCorner
{
  Eigen::Vector2d at;  ///< in the stored view
  PatchAlignment alignment;
  const Patch* patch;
};

}  // namespace

std::vector<Parameter> parameters(HomographyAlignerParams& params)
{
  return {
    integer("max_points", params.max_points, "", ">= 12", "corners of the view that are looked for"),
    integer("patch_radius", params.patch_radius, "px", "[2, 20]", "half the side of the patches that are compared"),
    integer("levels", params.levels, "", "[1, 6]", "levels of the image pyramid, the image among them"),
    real("min_correlation", params.min_correlation, "", "[0, 1)", "least correlation of a patch that is found again"),
    real("max_residual", params.max_residual, "px", "> 0", "largest error of a point that supports the homography"),
    integer("min_supporting", params.min_supporting, "", ">= 5", "points that make a homography"),
    real("min_support", params.min_support, "", "(0, 1]", "part of the points in sight that makes one"),
    boolean("refine", params.refine, "all pixels of the view's region refine the homography at last"),
  };
}

std::vector<std::string> HomographyAlignerParams::validate() const
{
  return faultsOf(*this);
}

class HomographyAligner::Impl
{
public:
  Impl(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
    : params_(params),
      region_(checkedRegion(reference, region, params)),
      points_(findCorners(reference, region_, params)),
      patches_(patchesOf(reference, points_, params)),
      refiner_(reference, region_, params.min_correlation)
  {
  }

  const Points& points() const
  {
    return points_;
  }

  TrackedHomography track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const;

private:
  TrackedHomography trackFrom(const std::vector<cv::Mat>& pyramid, const Eigen::Matrix3d& predicted,
                              int coarsest) const;
  /**
   * Improves h in one level of the pyramids.
   * @param verified that RANSAC agreed with h in a coarser level. @param result what is counted, and the points of level 0.
   * @return whether h can be relied on; if not, it says nothing any more.
   */
  bool trackLevel(const cv::Mat& current, std::size_t level, bool verified, Eigen::Matrix3d& h,
                  TrackedHomography& result) const;
  /** Sets h to what most corners agree with, and the corners' shifts to those that it leaves; false when too few agree. */
  bool verify(std::vector<FoundCorner>& corners, Eigen::Matrix3d& h) const;
  std::vector<FoundCorner> alignAll(const cv::Mat& current, std::size_t level, const Eigen::Matrix3d& h, int iterations,
                                    int& looked_for) const;

  HomographyAlignerParams params_;
  cv::Rect region_;
  Points points_;                            // pixels of the full image
  std::vector<std::vector<Patch>> patches_;  // of levels, of points
  RegionRefiner refiner_;
};

HomographyAligner::HomographyAligner(const cv::Mat& reference, const cv::Rect& region,
                                     const HomographyAlignerParams& params)
  : impl_(std::make_shared<const Impl>(reference, region, params))
{
}

TrackedHomography HomographyAligner::track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const
{
  return impl_->track(current, predicted);
}

const Points& HomographyAligner::points() const
{
  return impl_->points();
}

/** Looks for every point that h puts into the image, in one level. @param looked_for how many these are. */
std::vector<FoundCorner> HomographyAligner::Impl::alignAll(const cv::Mat& current, std::size_t level,
                                                           const Eigen::Matrix3d& h, int iterations,
                                                           int& looked_for) const
{
  const double scale = std::ldexp(1.0, -static_cast<int>(level));
  std::vector<FoundCorner> all;
  looked_for = 0;
  for (std::size_t i = 0; i < points_.size(); ++i)
  {
    const Patch& patch = patches_[level][i];
    const Eigen::Vector2d at = scale * points_[i];
    const Eigen::Vector2d expected = transfer(h, at);
    if (!patch.usable ||
        !(expected.x() >= 0.0 && expected.y() >= 0.0 && expected.x() < current.cols && expected.y() < current.rows))
    {
      continue;
    }
    ++looked_for;
    const std::optional<PatchAlignment> found = align(patch, at, current, h, iterations);
    if (found && found->correlation >= params_.min_correlation)
    {
      all.push_back({ at, *found, &patch });
    }
  }
  return all;
}

TrackedHomography HomographyAligner::Impl::track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const
{
  if (current.empty() || current.type() != CV_8UC1)
  {
    throw std::invalid_argument("the current image is not an 8-bit grey image");
  }
  constexpr double WELL_SUPPORTED = 0.6;  // part of the points in sight
  constexpr int SMALL_PATCHES = 1;        // level
  const std::vector<cv::Mat> pyramid = pyramidOf(current, static_cast<int>(patches_.size()));
  const int coarsest = static_cast<int>(pyramid.size()) - 1;
  TrackedHomography result = trackFrom(pyramid, predicted, coarsest);
  if (result.supporting < WELL_SUPPORTED * result.looked_for && coarsest > SMALL_PATCHES)
  {
    // The patches of coarse levels are wide: what hides a part spoils many of them.
    const TrackedHomography other = trackFrom(pyramid, predicted, SMALL_PATCHES);
    if (other.supporting > result.supporting)
    {
      result = other;
    }
  }
  if (result.found && params_.refine)
  {
    result.h = normalizedHomography(refiner_.refine(current, result.h));
  }
  return result;
}

TrackedHomography HomographyAligner::Impl::trackFrom(const std::vector<cv::Mat>& pyramid,
                                                     const Eigen::Matrix3d& predicted, int coarsest) const
{
  TrackedHomography result;
  Eigen::Matrix3d h = predicted;
  bool verified = false;
  for (int level = coarsest; level >= 0; --level)
  {
    const std::size_t l = static_cast<std::size_t>(level);
    const Eigen::Matrix3d down = toLevel(level);
    Eigen::Matrix3d h_level = down * h * down.inverse();
    verified = trackLevel(pyramid[l], l, verified, h_level, result);
    h = down.inverse() * h_level * down;
    if (!verified)
    {
      h = predicted;
      result.supporting = 0;
      result.points.clear();
    }
  }
  const int enough =
      std::max(params_.min_supporting, static_cast<int>(std::ceil(params_.min_support * result.looked_for)));
  result.found = result.supporting >= enough;
  if (result.found)
  {
    result.h = normalizedHomography(h);
  }
  return result;
}

bool HomographyAligner::Impl::trackLevel(const cv::Mat& current, std::size_t level, bool verified, Eigen::Matrix3d& h,
                                         TrackedHomography& result) const
{
  constexpr int COARSE_ITERATIONS = 5;
  constexpr int FINE_ITERATIONS = 2;
  constexpr std::size_t FINE_ROUNDS = 2;
  // Widths of the fits, times max_residual: what hides a part still looks a little like it, a few pixels off.
  constexpr std::array<double, FINE_ROUNDS> WIDTHS = { 2.0, 1.0 };
  const std::size_t rounds = level == 0 && verified ? FINE_ROUNDS : 1;
  for (std::size_t round = 0; round < rounds; ++round)
  {
    std::vector<FoundCorner> corners =
        alignAll(current, level, h, verified ? FINE_ITERATIONS : COARSE_ITERATIONS, result.looked_for);
    if (static_cast<int>(corners.size()) < params_.min_supporting || (!verified && !verify(corners, h)))
    {
      return false;
    }
    verified = true;
    ShiftFit fit(WIDTHS[round] * params_.max_residual);
    for (const FoundCorner& corner : corners)
    {
      fit.add(corner.at, corner.alignment.shift, corner.patch->information);
    }
    const std::optional<Eigen::Matrix3d> left = fit.solve();
    if (!left)
    {
      return false;
    }
    // What h shows at x is the stored view at left x.
    h = h * left->inverse();
    if (level == 0)
    {
      result.points = fit.supporting(*left, params_.max_residual, result.rms);
      result.supporting = static_cast<int>(result.points.size());
    }
  }
  return true;
}

bool HomographyAligner::Impl::verify(std::vector<FoundCorner>& corners, Eigen::Matrix3d& h) const
{
  Correspondences pairs;
  for (const FoundCorner& corner : corners)
  {
    pairs.push_back({ corner.at, corner.alignment.found });
  }
  const std::optional<Eigen::Matrix3d> agreed = mostAgreed(pairs, params_);
  if (!agreed)
  {
    return false;
  }
  h = *agreed;
  const Eigen::Matrix3d inverse = h.inverse();
  for (FoundCorner& corner : corners)
  {
    corner.alignment.shift = corner.at - transfer(inverse, corner.alignment.found);
  }
  return true;
}

}  // namespace view_servo
