// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/guided_matching.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/images/sampling.h"
#include "view_servo/images/universal_intrinsics.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
/** Jacobian of x_cur = H x_ref at a point. */
Eigen::Matrix2d affineApproximation(const Eigen::Matrix3d& h, const Eigen::Vector2d& at)
{
  const Eigen::Vector3d mapped = h * at.homogeneous();
  const Eigen::Vector2d image = mapped.hnormalized();
  return (h.topLeftCorner<2, 2>() - image * h.bottomLeftCorner<1, 2>()) / mapped.z();
}

/** A reference patch drawn in the pixels of the current image, with zero mean and, as integers, nearly unit norm. */
class Template
{
public:
  explicit Template(int radius)
    : radius_(radius),
      side_(2 * radius + 1),
      stride_(cv::alignSize(static_cast<std::size_t>(side_), LANES)),
      drawn_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_)),
      values_(static_cast<std::size_t>(side_) * stride_, 0)
  {
  }

  static constexpr int LANES = 8;  // numbers of 16 bits that are multiplied at once

  /**
   * @param to_reference maps offsets in the current image to offsets in the reference. False: leaves it, or is flat.
   */
  bool draw(const cv::Mat& reference, const Eigen::Vector2d& at, const Eigen::Matrix2d& to_reference)
  {
    constexpr double ROUNDING = 0.01;  // of places in single precision [px]
    const double reach = (to_reference.cwiseAbs() * Eigen::Vector2d(radius_, radius_)).maxCoeff() + ROUNDING;
    if (!(at.x() - reach >= 0.0 && at.y() - reach >= 0.0 && at.x() + reach < reference.cols - 1.0 &&
          at.y() + reach < reference.rows - 1.0))
    {
      return false;
    }
    const BilinearSampler sampler(reference);
    const Eigen::Vector2f middle = at.cast<float>();
    const Eigen::Matrix2f map = to_reference.cast<float>();
    const auto side = static_cast<std::size_t>(side_);
    for (int v = 0; v < side_; ++v)
    {
      const Eigen::Vector2f first =
          middle + static_cast<float>(v - radius_) * map.col(1) - static_cast<float>(radius_) * map.col(0);
      sampler.alongLine(first, map.col(0), side_, drawn_.data() + static_cast<std::size_t>(v) * side);
    }
    const Eigen::Map<const Eigen::ArrayXf> drawn(drawn_.data(), static_cast<Eigen::Index>(drawn_.size()));
    const float count = static_cast<float>(drawn_.size());
    const float mean = drawn.mean();
    const float variance = (drawn - mean).square().sum();
    if (!(variance > count))  // less than one grey level of deviation
    {
      return false;
    }
    // As large as sums of products with grey levels may be in 32 bits.
    const float largest = std::min(4095.0F, 2147483647.0F / (255.0F * count));
    const float scale = largest / std::max(drawn.maxCoeff() - mean, mean - drawn.minCoeff());
    sum_ = 0;
    for (std::size_t v = 0; v < side; ++v)
    {
      for (std::size_t u = 0; u < side; ++u)
      {
        const int value = cvRound(scale * (drawn_[v * side + u] - mean));
        values_[v * stride_ + u] = static_cast<short>(value);
        sum_ += value;
      }
    }
    to_unit_ = 1.0F / (scale * std::sqrt(variance));
    return true;
  }

  /** Sum of the products with the window of numbers of the same size that begins there; its rows are `stride` apart. */
  int product(const short* window, std::size_t stride) const
  {
    cv::v_int32x4 sums = cv::v_setzero_s32();
    const short* row = values_.data();
    for (int v = 0; v < side_; ++v, row += stride_, window += stride)
    {
      for (std::size_t u = 0; u < stride_; u += LANES)
      {
        sums = cv::v_dotprod(cv::v_load(row + u), cv::v_load(window + u), sums);
      }
    }
    return cv::v_reduce_sum(sums);
  }

  /** Correlation, in about [-1, 1], where such a window has that product, sum and sum of squares; 0 if it is flat. */
  float correlation(int product, std::uint32_t sum, std::uint32_t squares) const
  {
    const float count = static_cast<float>(side_ * side_);
    const float mean = static_cast<float>(sum) / count;
    const float variance = static_cast<float>(squares) - static_cast<float>(sum) * mean;
    const float rest = static_cast<float>(sum_) * mean;  // as rounded values have a mean
    return variance > count ? (static_cast<float>(product) - rest) * to_unit_ / std::sqrt(variance) : 0.0F;
  }

private:
  int radius_;
  int side_;
  std::size_t stride_;  // of rows, the rest of which is zero
  std::vector<float> drawn_;
  std::vector<short> values_;
  int sum_ = 0;           // of the values
  float to_unit_ = 0.0F;  // times the values: of unit norm
};

/** Part of an image around a place: its grey levels, and their sums over windows of one size. */
class SearchArea
{
public:
  /** @param side of the area. @param window side of the windows [px]. */
  SearchArea(int side, int window)
    : side_(side),
      window_(window),
      stride_(static_cast<std::size_t>(side) + Template::LANES),
      values_(static_cast<std::size_t>(side) * stride_ + Template::LANES, 0),
      sums_(static_cast<std::size_t>(side + 1) * static_cast<std::size_t>(side + 1), 0),
      squares_(sums_.size(), 0)
  {
  }

  /** @param u, v of its first pixel; the image has to contain the area. */
  void take(const cv::Mat& image, int u, int v)
  {
    const auto width = static_cast<std::size_t>(side_) + 1;
    for (int dv = 0; dv < side_; ++dv)
    {
      const unsigned char* from = image.ptr<unsigned char>(v + dv) + u;
      short* to = values_.data() + static_cast<std::size_t>(dv) * stride_;
      const std::size_t above = static_cast<std::size_t>(dv) * width;
      std::uint32_t sum = 0;
      std::uint32_t square = 0;
      for (std::size_t du = 0; du < static_cast<std::size_t>(side_); ++du)
      {
        const std::uint32_t grey = from[du];
        to[du] = static_cast<short>(grey);
        sum += grey;
        square += grey * grey;
        sums_[above + width + du + 1] = sums_[above + du + 1] + sum;
        squares_[above + width + du + 1] = squares_[above + du + 1] + square;
      }
    }
  }

  float correlation(const Template& patch, int u, int v) const
  {
    const int product = patch.product(values_.data() + static_cast<std::size_t>(v) * stride_ + u, stride_);
    return patch.correlation(product, within(sums_, u, v), within(squares_, u, v));
  }

private:
  /** Also where sums over the whole area overflow, those over a window do not. */
  std::uint32_t within(const std::vector<std::uint32_t>& integral, int u, int v) const
  {
    const auto width = static_cast<std::size_t>(side_) + 1;
    const std::size_t top = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
    const std::size_t bottom = top + static_cast<std::size_t>(window_) * width;
    const auto across = static_cast<std::size_t>(window_);
    return integral[bottom + across] - integral[bottom] - integral[top + across] + integral[top];
  }

  int side_;
  int window_;
  std::size_t stride_;  // of rows, longer than them as whole vectors are read
  std::vector<short> values_;
  std::vector<std::uint32_t> sums_;  // of all above and to the left
  std::vector<std::uint32_t> squares_;
};

/** Offset of a parabola's vertex through values at -1, 0, 1, of which the middle one is the largest. */
double vertex(float before, float middle, float after)
{
  const double curvature = static_cast<double>(before) - 2.0 * static_cast<double>(middle) + static_cast<double>(after);
  return curvature < 0.0 ? 0.5 * (static_cast<double>(before) - static_cast<double>(after)) / curvature : 0.0;
}

}  // namespace

std::vector<Parameter> parameters(GuidedParams& params)
{
  return {
    integer("patch_radius", params.patch_radius, "px", "[1, 50]",
            "radius of the patches that guided matching compares"),
    real("patch_correlation", params.min_correlation, "", "[0, 1)", "least correlation of the patches"),
  };
}

std::vector<std::string> GuidedParams::validate() const
{
  return faultsOf(*this);
}

std::vector<GuidedMatch> searchAlongHomography(const cv::Mat& reference, const std::vector<Corner>& corners,
                                               const cv::Mat& current, const Eigen::Matrix3d& h, double radius,
                                               const GuidedParams& params)
{
  const int reach = std::max(1, static_cast<int>(std::ceil(radius)));
  const int side = 2 * reach + 1;
  const int margin = reach + params.patch_radius;
  std::vector<std::optional<GuidedMatch>> found(corners.size());
  cv::parallel_for_(cv::Range(0, static_cast<int>(corners.size())), [&](const cv::Range& range) {
    Template patch(params.patch_radius);
    SearchArea area(side + 2 * params.patch_radius, 2 * params.patch_radius + 1);
    std::vector<float> correlations(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    for (int i = range.start; i < range.end; ++i)
    {
      const Eigen::Vector2d& at = corners[static_cast<std::size_t>(i)].position;
      const Eigen::Vector2d predicted = transfer(h, at);
      if (!(predicted.x() >= margin && predicted.y() >= margin && predicted.x() < current.cols - 1 - margin &&
            predicted.y() < current.rows - 1 - margin))
      {
        continue;
      }
      const Eigen::Matrix2d warp = affineApproximation(h, at);
      if (!(std::abs(warp.determinant()) > 1e-6) || !patch.draw(reference, at, warp.inverse()))
      {
        continue;
      }
      const int u0 = static_cast<int>(std::lround(predicted.x())) - reach;
      const int v0 = static_cast<int>(std::lround(predicted.y())) - reach;
      area.take(current, u0 - params.patch_radius, v0 - params.patch_radius);
      for (int k = 0; k < side * side; ++k)
      {
        correlations[static_cast<std::size_t>(k)] = area.correlation(patch, k % side, k / side);
      }
      const auto best = std::max_element(correlations.begin(), correlations.end());
      const int k = static_cast<int>(best - correlations.begin());
      const int du = k % side;
      const int dv = k / side;
      if (du == 0 || dv == 0 || du == side - 1 || dv == side - 1 || static_cast<double>(*best) < params.min_correlation)
      {
        continue;
      }
      const Eigen::Vector2d position(u0 + du + vertex(best[-1], *best, best[1]),
                                     v0 + dv + vertex(best[-side], *best, best[side]));
      found[static_cast<std::size_t>(i)] = { i, position, std::min(1.0, static_cast<double>(*best)) };
    }
  });
  std::vector<GuidedMatch> matches;
  for (const std::optional<GuidedMatch>& match : found)
  {
    if (match)
    {
      matches.push_back(*match);
    }
  }
  return matches;
}

AssociationMatrix associateAlongFundamental(const AssociationMatrix& association,
                                            const std::vector<Corner>& reference_corners,
                                            const std::vector<Corner>& current_corners, const Eigen::Matrix3d& f,
                                            double threshold)
{
  double largest = 0.0;
  for (const Association& entry : association.entries())
  {
    largest = std::max(largest, entry.weight);
  }
  const double limit = threshold * threshold;
  std::vector<Association> entries;
  for (const Association& entry : association.entries())
  {
    const Correspondence pair{ reference_corners[static_cast<std::size_t>(entry.row)].position,
                               current_corners[static_cast<std::size_t>(entry.column)].position };
    const double error = sampsonError(f, pair);
    if (error <= limit)
    {
      entries.push_back({ entry.row, entry.column, 1.0 - std::sqrt(error / limit) + entry.weight / largest });
    }
  }
  return AssociationMatrix(association.rows(), association.columns(), std::move(entries));
}

}  // namespace view_servo
