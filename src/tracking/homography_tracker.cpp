// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/homography_tracker.h"

#include "view_servo/features/corners.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/faults.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
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

/** Whether a square about a place, seen through a homography, lies in an image, with a pixel to spare. */
bool isInside(const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius, const cv::Size& size)
{
  for (const int du : { -radius, radius })
  {
    for (const int dv : { -radius, radius })
    {
      // A homography keeps what lies before the camera convex: the corners bound the rest.
      const Eigen::Vector2d corner = transfer(h, { place.x() + du, place.y() + dv });
      if (!(corner.x() >= 1.0 && corner.y() >= 1.0 && corner.x() < size.width - 2.0 && corner.y() < size.height - 2.0))
      {
        return false;
      }
    }
  }
  return true;
}

/** Bilinear; the place must lie inside. */
float sample(const cv::Mat& image, float u, float v)
{
  const int column = static_cast<int>(u);
  const int row = static_cast<int>(v);
  const float fu = u - static_cast<float>(column);
  const float fv = v - static_cast<float>(row);
  const unsigned char* p = image.ptr<unsigned char>(row) + column;
  const unsigned char* q = p + image.step;
  const float above = static_cast<float>(p[0]) + fu * static_cast<float>(p[1] - p[0]);
  const float below = static_cast<float>(q[0]) + fu * static_cast<float>(q[1] - q[0]);
  return above + fv * (below - above);
}

/** To zero mean and unit norm. @return the norm there was; 0, and nothing changes, when there is hardly any contrast. */
float normalize(std::vector<float>& values)
{
  constexpr float LEAST_DEVIATION = 2.0F;  // [grey levels]
  const float count = static_cast<float>(values.size());
  float sum = 0.0F;
  float squares = 0.0F;
  for (const float value : values)
  {
    sum += value;
    squares += value * value;
  }
  const float mean = sum / count;
  const float norm = std::sqrt(std::max(0.0F, squares - sum * mean));
  if (!(norm > LEAST_DEVIATION * std::sqrt(count)))
  {
    return 0.0F;
  }
  for (float& value : values)
  {
    value = (value - mean) / norm;
  }
  return norm;
}

/** RANSAC; empty when too few agree. */
std::optional<Eigen::Matrix3d> mostAgreed(const Correspondences& pairs, const HomographyTrackerParams& params)
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

/**
 * The homography near the identity that explains shifts of points, each with its information; least squares, with
 * Tukey's weights from the second round on.
 */
class ShiftFit
{
public:
  explicit ShiftFit(double width) : width_(width)
  {
  }

  void add(const Eigen::Vector2d& at, const Eigen::Vector2d& shift, const Eigen::Matrix2d& information)
  {
    shifts_.push_back({ at, shift, information });
  }

  std::optional<Eigen::Matrix3d> solve() const
  {
    constexpr int ROUNDS = 4;
    Eigen::Matrix3d fitted = Eigen::Matrix3d::Identity();
    // Coordinates about the middle and of the order of 1.
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Shift& shift : shifts_)
    {
      middle += shift.at / static_cast<double>(shifts_.size());
    }
    double spread = 0.0;
    for (const Shift& shift : shifts_)
    {
      spread += (shift.at - middle).norm() / static_cast<double>(shifts_.size());
    }
    if (!(spread > 0.0))
    {
      return std::nullopt;
    }
    Eigen::Matrix3d centring;
    centring << 1.0 / spread, 0.0, -middle.x() / spread, 0.0, 1.0 / spread, -middle.y() / spread, 0.0, 0.0, 1.0;
    const Eigen::Matrix3d uncentring = centring.inverse();
    for (int round = 0; round < ROUNDS; ++round)
    {
      Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
      Eigen::Matrix<double, 8, 1> right = Eigen::Matrix<double, 8, 1>::Zero();
      for (const Shift& shift : shifts_)
      {
        const Eigen::Vector2d residual = shift.shift + shift.at - transfer(fitted, shift.at);
        const double ratio = residual.squaredNorm() / (width_ * width_);
        if (!(ratio < 1.0))
        {
          continue;
        }
        const double weight = (1.0 - ratio) * (1.0 - ratio);
        const Eigen::Vector2d x = (shift.at - middle) / spread;
        Eigen::Matrix<double, 2, 8> jacobian;
        jacobian << x.x(), x.y(), 1.0, 0.0, 0.0, 0.0, -x.x() * x.x(), -x.x() * x.y(),  //
            0.0, 0.0, 0.0, x.x(), x.y(), 1.0, -x.x() * x.y(), -x.y() * x.y();
        const Eigen::Matrix<double, 8, 2> weighted = weight * jacobian.transpose() * shift.information;
        normal += weighted * jacobian;
        right += weighted * residual / spread;
      }
      const Eigen::LDLT<Eigen::Matrix<double, 8, 8>> ldlt(normal);
      if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0))
      {
        return std::nullopt;
      }
      const Eigen::Matrix<double, 8, 1> step = ldlt.solve(right);
      Eigen::Matrix3d change;
      change << 1.0 + step(0), step(1), step(2), step(3), 1.0 + step(4), step(5), step(6), step(7), 1.0;
      fitted = uncentring * change * centring * fitted;
    }
    return fitted;
  }

  /** How many shifts a fit explains to a residual, and the RMS of these [px]. */
  int supporting(const Eigen::Matrix3d& fitted, double max_residual, double& rms) const
  {
    int count = 0;
    double squares = 0.0;
    for (const Shift& shift : shifts_)
    {
      const double squared = (shift.shift + shift.at - transfer(fitted, shift.at)).squaredNorm();
      if (squared <= max_residual * max_residual)
      {
        ++count;
        squares += squared;
      }
    }
    rms = std::sqrt(squares / std::max(count, 1));
    return count;
  }

private:
  struct Shift
  {
    Eigen::Vector2d at;
    Eigen::Vector2d shift;
    Eigen::Matrix2d information;
  };

  double width_;
  std::vector<Shift> shifts_;
};

}  // namespace

std::vector<std::string> HomographyTrackerParams::validate() const
{
  Faults faults;
  faults.require(max_points >= 12, "max_points must be at least 12");
  faults.require(patch_radius >= 2 && patch_radius <= 20, "patch_radius must lie in [2, 20] px");
  faults.require(levels >= 1 && levels <= 6, "levels must lie in [1, 6]");
  faults.require(min_correlation >= 0.0 && min_correlation < 1.0, "min_correlation must lie in [0, 1)");
  faults.require(max_residual > 0.0, "max_residual must be more than 0 px");
  faults.require(min_supporting >= 5, "min_supporting must be at least 5");
  faults.require(min_support > 0.0 && min_support <= 1.0, "min_support must lie in (0, 1]");
  return faults.list();
}

HomographyTracker::HomographyTracker(const cv::Mat& reference, const cv::Rect& region,
                                     const HomographyTrackerParams& params)
  : params_(params)
{
  constexpr int COARSE_RADIUS = 6;  // [px]
  constexpr double SPREAD = 0.5;    // of the distance that corners on a grid would have
  requireNoFaults("parameters of the homography tracker", params.validate());
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
  cv::Mat mask(reference.size(), CV_8UC1, cv::Scalar(0));
  mask(used).setTo(255);
  CornerParams corners;
  corners.max_corners = params.max_points;
  corners.min_distance = SPREAD * std::sqrt(static_cast<double>(used.area()) / params.max_points);
  corners.border = params.patch_radius + 2;
  for (const Corner& corner : detectCorners(reference, corners, mask))
  {
    points_.push_back(corner.position);
  }
  if (static_cast<int>(points_.size()) < params.min_supporting)
  {
    throw std::invalid_argument("the stored view has " + std::to_string(points_.size()) + " corners to track, " +
                                std::to_string(params.min_supporting) + " are needed");
  }
  const std::vector<cv::Mat> pyramid = pyramidOf(reference, params.levels);
  for (std::size_t level = 0; level < pyramid.size(); ++level)
  {
    std::vector<Patch> patches;
    const double scale = std::ldexp(1.0, -static_cast<int>(level));
    const int radius = level == 0 ? params.patch_radius : std::min(params.patch_radius, COARSE_RADIUS);
    for (const Eigen::Vector2d& point : points_)
    {
      patches.push_back(makePatch(pyramid[level], scale * point, radius));
    }
    patches_.push_back(std::move(patches));
  }
}

HomographyTracker::Patch HomographyTracker::makePatch(const cv::Mat& image, const Eigen::Vector2d& at, int radius)
{
  const double margin = radius + 2.0;
  Patch patch;
  patch.radius = radius;
  if (!(at.x() >= margin && at.y() >= margin && at.x() < image.cols - margin && at.y() < image.rows - margin))
  {
    return patch;
  }
  std::vector<float> gradient_u;
  std::vector<float> gradient_v;
  for (int dv = -radius; dv <= radius; ++dv)
  {
    for (int du = -radius; du <= radius; ++du)
    {
      const float u = static_cast<float>(at.x() + du);
      const float v = static_cast<float>(at.y() + dv);
      patch.values.push_back(sample(image, u, v));
      gradient_u.push_back(0.5F * (sample(image, u + 1.0F, v) - sample(image, u - 1.0F, v)));
      gradient_v.push_back(0.5F * (sample(image, u, v + 1.0F) - sample(image, u, v - 1.0F)));
    }
  }
  // The normalised values change by the gradient without its mean and without its part along the values.
  const float norm = normalize(patch.values);
  if (!(norm > 0.0F))
  {
    return patch;
  }
  const auto tangent = [&](std::vector<float>& gradient) {
    float average = 0.0F;
    float along = 0.0F;
    for (std::size_t i = 0; i < gradient.size(); ++i)
    {
      gradient[i] /= norm;
      average += gradient[i] / static_cast<float>(gradient.size());
      along += gradient[i] * patch.values[i];
    }
    for (std::size_t i = 0; i < gradient.size(); ++i)
    {
      gradient[i] -= average + along * patch.values[i];
    }
  };
  tangent(gradient_u);
  tangent(gradient_v);
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < gradient_u.size(); ++i)
  {
    const Eigen::Vector2d gradient(gradient_u[i], gradient_v[i]);
    hessian += gradient * gradient.transpose();
  }
  constexpr double LEAST_RATIO = 0.02;  // of the Hessian's eigenvalues: less is an edge, which tells one direction
  const double trace = hessian.trace();
  if (!(hessian.determinant() > LEAST_RATIO * trace * trace / 4.0))
  {
    return patch;
  }
  patch.information = hessian;
  const Eigen::Matrix2d inverse = hessian.inverse();
  for (std::size_t i = 0; i < gradient_u.size(); ++i)
  {
    const Eigen::Vector2d step = inverse * Eigen::Vector2d(gradient_u[i], gradient_v[i]);
    patch.descent_u.push_back(static_cast<float>(step.x()));
    patch.descent_v.push_back(static_cast<float>(step.y()));
  }
  patch.usable = true;
  return patch;
}

bool HomographyTracker::align(const cv::Mat& current, const Patch& patch, const Eigen::Matrix3d& h, int iterations,
                              Alignment& alignment)
{
  constexpr double CONVERGED = 0.005;  // step [px of the stored view]
  constexpr double LARGEST = 1.5;      // way, in radii
  const int radius = patch.radius;
  const Eigen::Vector3f along = h.col(0).cast<float>();
  alignment.shift.setZero();
  std::vector<float> values(patch.values.size());
  for (int iteration = 0;; ++iteration)
  {
    const Eigen::Vector2d place = alignment.at - alignment.shift;
    alignment.found = transfer(h, place);
    if (!isInside(h, place, radius, current.size()))
    {
      return false;
    }
    std::size_t i = 0;
    for (int dv = -radius; dv <= radius; ++dv)
    {
      Eigen::Vector3f x = (h * Eigen::Vector3d(place.x() - radius, place.y() + dv, 1.0)).cast<float>();
      for (int du = -radius; du <= radius; ++du, ++i)
      {
        const float inverse = 1.0F / x.z();
        values[i] = sample(current, x.x() * inverse, x.y() * inverse);
        x += along;
      }
    }
    if (!(normalize(values) > 0.0F))
    {
      return false;
    }
    float shift_u = 0.0F;
    float shift_v = 0.0F;
    float dot = 0.0F;
    for (i = 0; i < values.size(); ++i)
    {
      const float difference = values[i] - patch.values[i];
      shift_u += patch.descent_u[i] * difference;
      shift_v += patch.descent_v[i] * difference;
      dot += values[i] * patch.values[i];
    }
    alignment.correlation = static_cast<double>(dot);
    const Eigen::Vector2d shift(shift_u, shift_v);
    alignment.shift += shift;
    if (!(alignment.shift.norm() < LARGEST * radius))
    {
      return false;
    }
    if (iteration + 1 >= iterations || shift.norm() < CONVERGED)
    {
      alignment.found = transfer(h, alignment.at - alignment.shift);
      return true;
    }
  }
}

std::vector<HomographyTracker::Alignment> HomographyTracker::alignAll(const cv::Mat& current, std::size_t level,
                                                                      const Eigen::Matrix3d& h, int iterations,
                                                                      int& looked_for) const
{
  const double scale = std::ldexp(1.0, -static_cast<int>(level));
  std::vector<Alignment> alignments;
  looked_for = 0;
  for (std::size_t i = 0; i < points_.size(); ++i)
  {
    const Patch& patch = patches_[level][i];
    Alignment alignment{ scale * points_[i], {}, {}, 0.0, &patch };
    const Eigen::Vector2d expected = transfer(h, alignment.at);
    if (!patch.usable ||
        !(expected.x() >= 0.0 && expected.y() >= 0.0 && expected.x() < current.cols && expected.y() < current.rows))
    {
      continue;
    }
    ++looked_for;
    if (align(current, patch, h, iterations, alignment) && alignment.correlation >= params_.min_correlation)
    {
      alignments.push_back(alignment);
    }
  }
  return alignments;
}

TrackedHomography HomographyTracker::track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const
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
  return result;
}

TrackedHomography HomographyTracker::trackFrom(const std::vector<cv::Mat>& pyramid, const Eigen::Matrix3d& predicted,
                                               int coarsest) const
{
  constexpr int COARSE_ITERATIONS = 5;
  constexpr int FINE_ITERATIONS = 2;
  constexpr int FINE_ROUNDS = 3;
  // Widths of the fits, times max_residual: what hides a part still looks a little like it, a few pixels off.
  constexpr std::array<double, FINE_ROUNDS> WIDTHS = { 2.0, 1.0, 0.5 };
  TrackedHomography result;
  Eigen::Matrix3d h = predicted;
  bool verified = false;  // by RANSAC
  for (int level = coarsest; level >= 0; --level)
  {
    const std::size_t l = static_cast<std::size_t>(level);
    const Eigen::Matrix3d down = toLevel(level);
    Eigen::Matrix3d h_level = down * h * down.inverse();
    const int rounds = level == 0 && verified ? FINE_ROUNDS : 1;
    for (int round = 0; round < rounds; ++round)
    {
      std::vector<Alignment> alignments =
          alignAll(pyramid[l], l, h_level, verified ? FINE_ITERATIONS : COARSE_ITERATIONS, result.looked_for);
      if (static_cast<int>(alignments.size()) < params_.min_supporting)
      {
        verified = false;
        break;
      }
      if (!verified)
      {
        Correspondences pairs;
        for (const Alignment& alignment : alignments)
        {
          pairs.push_back({ alignment.at, alignment.found });
        }
        const std::optional<Eigen::Matrix3d> found = mostAgreed(pairs, params_);
        if (!found)
        {
          break;
        }
        verified = true;
        // The shifts that this homography leaves.
        const Eigen::Matrix3d inverse = found->inverse();
        for (Alignment& alignment : alignments)
        {
          alignment.shift = alignment.at - transfer(inverse, alignment.found);
        }
        h_level = *found;
      }
      ShiftFit fit(WIDTHS[static_cast<std::size_t>(round)] * params_.max_residual);
      for (const Alignment& alignment : alignments)
      {
        fit.add(alignment.at, alignment.shift, alignment.patch->information);
      }
      const std::optional<Eigen::Matrix3d> left = fit.solve();
      if (!left)
      {
        verified = false;
        break;
      }
      // What h shows at x is the stored view at left x.
      h_level = h_level * left->inverse();
      if (level == 0)
      {
        result.supporting = fit.supporting(*left, params_.max_residual, result.rms);
      }
    }
    h = down.inverse() * h_level * down;
    if (!verified)
    {
      h = predicted;
      result.supporting = 0;
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

}  // namespace view_servo
