// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/homography_aligner.h"

#include "view_servo/features/corners.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/faults.h"
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
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int BLOCK_RADIUS = 10;  // [px]

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

/** The square about a place of the stored view, seen through a homography; it must lie inside. */
void warp(const cv::Mat& current, const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius,
          std::vector<float>& values)
{
  const Eigen::Vector3f along = h.col(0).cast<float>();
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

/** The gradient of values that normalize() has worked on: without its mean and without its part along the values. */
void normalizeGradient(const std::vector<float>& values, float norm, std::vector<float>& gradient)
{
  float average = 0.0F;
  float along = 0.0F;
  for (std::size_t i = 0; i < gradient.size(); ++i)
  {
    gradient[i] /= norm;
    average += gradient[i] / static_cast<float>(gradient.size());
    along += gradient[i] * values[i];
  }
  for (std::size_t i = 0; i < gradient.size(); ++i)
  {
    gradient[i] -= average + along * values[i];
  }
}

using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Vector8 = Eigen::Matrix<double, 8, 1>;

/** How a homography near the identity, I + [p0 p1 p2; p3 p4 p5; p6 p7 0], shifts a place. */
Eigen::Matrix<double, 2, 8> shiftByChange(const Eigen::Vector2d& x)
{
  Eigen::Matrix<double, 2, 8> jacobian;
  jacobian << x.x(), x.y(), 1.0, 0.0, 0.0, 0.0, -x.x() * x.x(), -x.x() * x.y(),  //
      0.0, 0.0, 0.0, x.x(), x.y(), 1.0, -x.x() * x.y(), -x.y() * x.y();
  return jacobian;
}

/** I + the change that solves the normal equations, in pixels; empty when they are singular. */
std::optional<Eigen::Matrix3d> solveChange(const Matrix8& normal, const Vector8& right, const Eigen::Vector2d& middle,
                                           double spread)
{
  const Eigen::LDLT<Matrix8> ldlt(normal);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0))
  {
    return std::nullopt;
  }
  const Vector8 step = ldlt.solve(right);
  Eigen::Matrix3d change;
  change << 1.0 + step(0), step(1), step(2), step(3), 1.0 + step(4), step(5), step(6), step(7), 1.0;
  Eigen::Matrix3d centring;
  centring << 1.0 / spread, 0.0, -middle.x() / spread, 0.0, 1.0 / spread, -middle.y() / spread, 0.0, 0.0, 1.0;
  return Eigen::Matrix3d(centring.inverse() * change * centring);
}

/** So that it matters less that interpolation smooths, the more so the further from whole pixels. */
cv::Mat smoothed(const cv::Mat& image)
{
  constexpr double SIGMA = 0.8;  // [px]
  cv::Mat result;
  cv::GaussianBlur(image, result, cv::Size(5, 5), SIGMA);
  return result;
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
        const Eigen::Vector2d x = (shift.at - middle) / spread;
        const Eigen::Matrix<double, 2, 8> jacobian = shiftByChange(x);
        const Eigen::Matrix<double, 8, 2> weighted = weight * jacobian.transpose() * shift.information;
        normal += weighted * jacobian;
        right += weighted * residual / spread;
      }
      const std::optional<Eigen::Matrix3d> change = solveChange(normal, right, middle, spread);
      if (!change)
      {
        return std::nullopt;
      }
      fitted = *change * fitted;
    }
    return fitted;
  }

  /** Where the shifts are that a fit explains to a residual, and the RMS of these [px]. */
  Points supporting(const Eigen::Matrix3d& fitted, double max_residual, double& rms) const
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

HomographyAligner::HomographyAligner(const cv::Mat& reference, const cv::Rect& region,
                                     const HomographyAlignerParams& params)
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
  makeBlocks(smoothed(reference), used);
}

void HomographyAligner::makeBlocks(const cv::Mat& image, const cv::Rect& region)
{
  centring_.middle = { region.x + 0.5 * (region.width - 1), region.y + 0.5 * (region.height - 1) };
  centring_.spread = 0.25 * (region.width + region.height);
  const cv::Rect inner = region & cv::Rect(1, 1, image.cols - 3, image.rows - 3);  // where there are gradients
  const int side = 2 * BLOCK_RADIUS + 1;
  for (int top = inner.y; top + side <= inner.br().y; top += side)
  {
    for (int left = inner.x; left + side <= inner.br().x; left += side)
    {
      Block block;
      block.at = { left + BLOCK_RADIUS, top + BLOCK_RADIUS };
      for (int v = top; v < top + side; ++v)
      {
        const unsigned char* row = image.ptr<unsigned char>(v);
        const unsigned char* above = image.ptr<unsigned char>(v - 1);
        const unsigned char* below = image.ptr<unsigned char>(v + 1);
        for (int u = left; u < left + side; ++u)
        {
          block.values.push_back(row[u]);
          block.gradient_u.push_back(0.5F * static_cast<float>(row[u + 1] - row[u - 1]));
          block.gradient_v.push_back(0.5F * static_cast<float>(below[u] - above[u]));
        }
      }
      block.norm = normalize(block.values);
      if (!(block.norm > 0.0F))
      {
        continue;
      }
      normalizeGradient(block.values, block.norm, block.gradient_u);
      normalizeGradient(block.values, block.norm, block.gradient_v);
      block.information.setZero();
      std::size_t i = 0;
      for (int dv = -BLOCK_RADIUS; dv <= BLOCK_RADIUS; ++dv)
      {
        for (int du = -BLOCK_RADIUS; du <= BLOCK_RADIUS; ++du, ++i)
        {
          const Eigen::Vector2d x = (block.at + Eigen::Vector2d(du, dv) - centring_.middle) / centring_.spread;
          const Eigen::RowVector2d gradient(block.gradient_u[i], block.gradient_v[i]);
          const Eigen::Matrix<double, 1, 8> row = block.norm * centring_.spread * gradient * shiftByChange(x);
          block.information += row.transpose() * row;
        }
      }
      blocks_.push_back(std::move(block));
    }
  }
}

Eigen::Matrix3d HomographyAligner::refine(const cv::Mat& current, const Eigen::Matrix3d& h) const
{
  constexpr int ITERATIONS = 2;
  constexpr double WIDTH = 3.0;      // of the weights, in median deviations
  constexpr double FARTHEST = 10.0;  // that a step is believed, of a corner of the region [px]
  constexpr double CONVERGED = 0.1;  // likewise: the next step would hardly move it
  constexpr int SIDE = 2 * BLOCK_RADIUS + 1;
  using Row = Eigen::Array<float, SIDE, 1>;
  constexpr std::size_t FEWEST = 12;  // blocks
  const auto largest_shift = [this](const Eigen::Matrix3d& change) {
    double largest = 0.0;
    for (const double u : { -1.0, 1.0 })
    {
      for (const double v : { -1.0, 1.0 })
      {
        const Eigen::Vector2d corner = centring_.middle + centring_.spread * Eigen::Vector2d(u, v);
        largest = std::max(largest, (transfer(change, corner) - corner).norm());
      }
    }
    return largest;
  };
  struct Seen
  {
    const Block* block;
    double deviation;  // of its pixels [grey levels]
    Vector8 right;
  };
  Eigen::Matrix3d refined = h;
  std::vector<float> values(static_cast<std::size_t>(SIDE * SIDE));
  const float per_spread = static_cast<float>(1.0 / centring_.spread);
  const Row offsets = Row::LinSpaced(SIDE, -static_cast<float>(BLOCK_RADIUS), static_cast<float>(BLOCK_RADIUS));
  for (int iteration = 0; iteration < ITERATIONS; ++iteration)
  {
    std::vector<Seen> all;
    std::vector<double> deviations;
    for (const Block& block : blocks_)
    {
      if (!isInside(refined, block.at, BLOCK_RADIUS, current.size()))
      {
        continue;
      }
      warp(current, refined, block.at, BLOCK_RADIUS, values);
      if (!(normalize(values) > 0.0F))
      {
        continue;
      }
      // Of the gradients times the differences, sums along the rows: of them, times x, and times x².
      float squares = 0.0F;
      Eigen::Matrix<float, 8, 1> right = Eigen::Matrix<float, 8, 1>::Zero();
      const Row x = (static_cast<float>(block.at.x() - centring_.middle.x()) + offsets) * per_spread;
      for (int row = 0; row < SIDE; ++row)
      {
        const float y = static_cast<float>(block.at.y() + row - BLOCK_RADIUS - centring_.middle.y()) * per_spread;
        const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(row) * SIDE;
        const auto row_of = [first](const std::vector<float>& numbers) {
          return Eigen::Map<const Row>(numbers.data() + first);
        };
        const Row difference = row_of(values) - row_of(block.values);
        const Row along_u = difference * row_of(block.gradient_u);
        const Row along_v = difference * row_of(block.gradient_v);
        const float u = along_u.sum();
        const float v = along_v.sum();
        const float xu = (x * along_u).sum();
        const float xv = (x * along_v).sum();
        squares += difference.square().sum();
        right(0) += xu;
        right(1) += y * u;
        right(2) += u;
        right(3) += xv;
        right(4) += y * v;
        right(5) += v;
        right(6) -= (x.square() * along_u).sum() + y * xv;
        right(7) -= y * (xu + y * v);
      }
      if (!(1.0F - 0.5F * squares >= static_cast<float>(params_.min_correlation)))
      {
        continue;
      }
      const double scale = static_cast<double>(block.norm) * static_cast<double>(block.norm) * centring_.spread;
      const double deviation = block.norm * std::sqrt(squares / static_cast<float>(values.size()));
      all.push_back({ &block, deviation, scale * right.cast<double>() });
      deviations.push_back(deviation);
    }
    if (all.size() < FEWEST)
    {
      return refined;
    }
    const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
    std::nth_element(deviations.begin(), middle, deviations.end());
    Matrix8 normal = Matrix8::Zero();
    Vector8 right = Vector8::Zero();
    for (const Seen& seen : all)
    {
      const double ratio = seen.deviation / (WIDTH * std::max(*middle, 1e-3));
      const double weight = ratio < 1.0 ? (1.0 - ratio * ratio) * (1.0 - ratio * ratio) : 0.0;
      normal += weight * seen.block->information;
      right += weight * seen.right;
    }
    const std::optional<Eigen::Matrix3d> left = solveChange(normal, right, centring_.middle, centring_.spread);
    const double shift = left ? largest_shift(*left) : std::numeric_limits<double>::infinity();
    if (!(shift < FARTHEST))
    {
      return h;
    }
    refined = refined * left->inverse();
    if (shift < CONVERGED)
    {
      return refined;
    }
  }
  return refined;
}

HomographyAligner::Patch HomographyAligner::makePatch(const cv::Mat& image, const Eigen::Vector2d& at, int radius)
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
  const float norm = normalize(patch.values);
  if (!(norm > 0.0F))
  {
    return patch;
  }
  normalizeGradient(patch.values, norm, gradient_u);
  normalizeGradient(patch.values, norm, gradient_v);
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < gradient_u.size(); ++i)
  {
    const Eigen::Vector2d gradient(gradient_u[i], gradient_v[i]);
    hessian += gradient * gradient.transpose();
  }
  constexpr double NOISE = 3.0;           // of a pixel [grey levels]
  constexpr double DISSIMILARITY = 0.02;  // of a pixel, of the norm of a patch
  constexpr double LEAST_RATIO = 0.02;    // of the Hessian's eigenvalues: less is an edge, which tells one direction
  const double trace = hessian.trace();
  if (!(hessian.determinant() > LEAST_RATIO * trace * trace / 4.0))
  {
    return patch;
  }
  // Values are off by noise, and by as large a part of their contrast as they are not sampled or seen alike.
  patch.information = hessian / (NOISE * NOISE / (norm * norm) + DISSIMILARITY * DISSIMILARITY);
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

bool HomographyAligner::align(const cv::Mat& current, const Patch& patch, const Eigen::Matrix3d& h, int iterations,
                              Alignment& alignment)
{
  constexpr double CONVERGED = 0.005;  // step [px of the stored view]
  constexpr double LARGEST = 1.5;      // way, in radii
  const int radius = patch.radius;
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
    warp(current, h, place, radius, values);
    if (!(normalize(values) > 0.0F))
    {
      return false;
    }
    float shift_u = 0.0F;
    float shift_v = 0.0F;
    float dot = 0.0F;
    for (std::size_t i = 0; i < values.size(); ++i)
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

std::vector<HomographyAligner::Alignment> HomographyAligner::alignAll(const cv::Mat& current, std::size_t level,
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

TrackedHomography HomographyAligner::track(const cv::Mat& current, const Eigen::Matrix3d& predicted) const
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
    result.h = normalizedHomography(refine(smoothed(current), result.h));
  }
  return result;
}

TrackedHomography HomographyAligner::trackFrom(const std::vector<cv::Mat>& pyramid, const Eigen::Matrix3d& predicted,
                                               int coarsest) const
{
  constexpr int COARSE_ITERATIONS = 5;
  constexpr int FINE_ITERATIONS = 2;
  constexpr int FINE_ROUNDS = 2;
  // Widths of the fits, times max_residual: what hides a part still looks a little like it, a few pixels off.
  constexpr std::array<double, FINE_ROUNDS> WIDTHS = { 2.0, 1.0 };
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
        result.points = fit.supporting(*left, params_.max_residual, result.rms);
        result.supporting = static_cast<int>(result.points.size());
      }
    }
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

}  // namespace view_servo
