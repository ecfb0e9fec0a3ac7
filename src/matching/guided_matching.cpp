// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/guided_matching.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
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

/** A reference patch drawn in the pixels of the current image, with zero mean and unit norm. */
class Template
{
public:
  explicit Template(int radius)
    : radius_(radius), values_(static_cast<std::size_t>(2 * radius + 1) * static_cast<std::size_t>(2 * radius + 1))
  {
  }

  /** @param to_reference maps offsets in the current image to offsets in the reference. False: leaves it, or is flat. */
  bool draw(const cv::Mat& reference, const Eigen::Vector2d& at, const Eigen::Matrix2d& to_reference)
  {
    const double reach = (to_reference.cwiseAbs() * Eigen::Vector2d(radius_, radius_)).maxCoeff();
    if (!(at.x() - reach >= 0.0 && at.y() - reach >= 0.0 && at.x() + reach < reference.cols - 1.0 &&
          at.y() + reach < reference.rows - 1.0))
    {
      return false;
    }
    float sum = 0.0F;
    float squares = 0.0F;
    std::size_t i = 0;
    for (int dv = -radius_; dv <= radius_; ++dv)
    {
      for (int du = -radius_; du <= radius_; ++du, ++i)
      {
        const Eigen::Vector2f x = (at + to_reference * Eigen::Vector2d(du, dv)).cast<float>();
        const int u = static_cast<int>(x.x());
        const int v = static_cast<int>(x.y());
        const float fx = x.x() - static_cast<float>(u);
        const float fy = x.y() - static_cast<float>(v);
        const unsigned char* p = reference.ptr<unsigned char>(v) + u;
        const unsigned char* q = reference.ptr<unsigned char>(v + 1) + u;
        const float upper = static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
        const float lower = static_cast<float>(q[0]) + fx * static_cast<float>(q[1] - q[0]);
        values_[i] = upper + fy * (lower - upper);
        sum += values_[i];
        squares += values_[i] * values_[i];
      }
    }
    const float count = static_cast<float>(values_.size());
    const float variance = squares - sum * sum / count;
    if (!(variance > count))  // less than one grey level of deviation
    {
      return false;
    }
    const float scale = 1.0F / std::sqrt(variance);
    for (float& value : values_)
    {
      value = (value - sum / count) * scale;
    }
    return true;
  }

  /** Correlation, in [-1, 1], with the patch around a pixel of the current image, which must contain it; 0 if flat. */
  float correlate(const cv::Mat& current, int u, int v) const
  {
    const int side = 2 * radius_ + 1;
    float product = 0.0F;
    int sum = 0;
    int squares = 0;
    const float* value = values_.data();
    for (int dv = -radius_; dv <= radius_; ++dv, value += side)
    {
      const unsigned char* row = current.ptr<unsigned char>(v + dv) + (u - radius_);
      for (int i = 0; i < side; ++i)
      {
        const int intensity = row[i];
        product += value[i] * static_cast<float>(intensity);
        sum += intensity;
        squares += intensity * intensity;
      }
    }
    const float count = static_cast<float>(side * side);
    const float variance = static_cast<float>(squares) - static_cast<float>(sum) * static_cast<float>(sum) / count;
    return variance > count ? product / std::sqrt(variance) : 0.0F;
  }

private:
  int radius_;
  std::vector<float> values_;
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
    integer("patch_radius", params.patch_radius, "px", "[1, 50]", "patches compared by guided matching"),
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
      for (int k = 0; k < side * side; ++k)
      {
        correlations[static_cast<std::size_t>(k)] = patch.correlate(current, u0 + k % side, v0 + k / side);
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
