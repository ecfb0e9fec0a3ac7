// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/homography_aligner.h"

#include "corner_patches.h"
#include "patch.h"
#include "region_refiner.h"
#include "shift_fit.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace view_servo
{
namespace
{
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
   * @param verified that RANSAC agreed with h in a coarser level. @param result what is counted, and the points of
   * level 0.
   * @return whether h can be relied on; if not, it says nothing any more.
   */
  bool trackLevel(const cv::Mat& current, std::size_t level, bool verified, Eigen::Matrix3d& h,
                  TrackedHomography& result) const;
  /**
   * Sets h to what most corners agree with, and the corners' shifts to those that it leaves; false when too few agree.
   */
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
