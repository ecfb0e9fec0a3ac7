// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "region_refiner.h"

#include "patch.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/robust/quantile.h"

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
/** Interpolation smooths, the more so the further from whole pixels; that matters less in images that are smooth. */
cv::Mat smoothed(const cv::Mat& image)
{
  constexpr double SIGMA = 0.8;  // [px]
  cv::Mat result;
  cv::GaussianBlur(image, result, cv::Size(5, 5), SIGMA);
  return result;
}

}  // namespace

RegionRefiner::RegionRefiner(const cv::Mat& reference, const cv::Rect& region, double min_correlation)
  : min_correlation_(static_cast<float>(min_correlation))
{
  centring_.middle = middleOf(region);
  centring_.spread = 0.25 * (region.width + region.height);
  const cv::Mat image = smoothed(reference);
  const cv::Rect inner = region & cv::Rect(1, 1, image.cols - 3, image.rows - 3);  // where there are gradients
  for (int top = inner.y; top + SIDE <= inner.br().y; top += SIDE)
  {
    for (int left = inner.x; left + SIDE <= inner.br().x; left += SIDE)
    {
      std::optional<Block> block = makeBlock(image, { left, top });
      if (block)
      {
        blocks_.push_back(std::move(*block));
      }
    }
  }
}

/** Empty when it has hardly any contrast. */
std::optional<RegionRefiner::Block> RegionRefiner::makeBlock(const cv::Mat& image, const cv::Point& corner) const
{
  Block block;
  block.at = { corner.x + RADIUS, corner.y + RADIUS };
  for (int v = corner.y; v < corner.y + SIDE; ++v)
  {
    const unsigned char* row = image.ptr<unsigned char>(v);
    const unsigned char* above = image.ptr<unsigned char>(v - 1);
    const unsigned char* below = image.ptr<unsigned char>(v + 1);
    for (int u = corner.x; u < corner.x + SIDE; ++u)
    {
      block.values.push_back(row[u]);
      block.gradient_u.push_back(0.5F * static_cast<float>(row[u + 1] - row[u - 1]));
      block.gradient_v.push_back(0.5F * static_cast<float>(below[u] - above[u]));
    }
  }
  block.norm = normalize(block.values);
  if (!(block.norm > 0.0F))
  {
    return std::nullopt;
  }
  normalizeGradient(block.values, block.norm, block.gradient_u);
  normalizeGradient(block.values, block.norm, block.gradient_v);
  block.information = informationOf(block);
  return block;
}

Matrix8 RegionRefiner::informationOf(const Block& block) const
{
  Matrix8 information = Matrix8::Zero();
  std::size_t i = 0;
  for (int dv = -RADIUS; dv <= RADIUS; ++dv)
  {
    for (int du = -RADIUS; du <= RADIUS; ++du, ++i)
    {
      const Eigen::Vector2d x = centring_.apply(block.at + Eigen::Vector2d(du, dv));
      const Eigen::RowVector2d gradient(block.gradient_u[i], block.gradient_v[i]);
      const Eigen::Matrix<double, 1, 8> row = block.norm * centring_.spread * gradient * shiftByChange(x);
      information += row.transpose() * row;
    }
  }
  return information;
}

Eigen::Matrix3d RegionRefiner::refine(const cv::Mat& current, const Eigen::Matrix3d& h) const
{
  constexpr int ITERATIONS = 2;
  constexpr double FARTHEST = 10.0;   // that a step is believed, of a corner of the region [px]
  constexpr double CONVERGED = 0.1;   // likewise: the next step would hardly move it
  constexpr std::size_t FEWEST = 12;  // blocks
  const cv::Mat image = smoothed(current);
  Eigen::Matrix3d refined = h;
  for (int iteration = 0; iteration < ITERATIONS; ++iteration)
  {
    const std::vector<SeenBlock> seen = seenBlocks(image, refined);
    if (seen.size() < FEWEST)
    {
      return refined;
    }
    const std::optional<Eigen::Matrix3d> change = solve(seen);
    const double shift = change ? largestShift(*change) : std::numeric_limits<double>::infinity();
    if (!(shift < FARTHEST))
    {
      return h;
    }
    // What `refined` shows at x is the stored view at change x.
    refined = refined * change->inverse();
    if (shift < CONVERGED)
    {
      return refined;
    }
  }
  return refined;
}

/** Those that lie in the image and look alike there. */
std::vector<RegionRefiner::SeenBlock> RegionRefiner::seenBlocks(const cv::Mat& current, const Eigen::Matrix3d& h) const
{
  std::vector<SeenBlock> all;
  std::vector<float> values(static_cast<std::size_t>(SIDE * SIDE));
  for (const Block& block : blocks_)
  {
    if (!squareIsInside(h, block.at, RADIUS, current.size()))
    {
      continue;
    }
    warpSquare(current, h, block.at, RADIUS, values);
    if (!(normalize(values) > 0.0F))
    {
      continue;
    }
    if (const std::optional<SeenBlock> seen = compare(block, values))
    {
      all.push_back(*seen);
    }
  }
  return all;
}

/** Empty when the normalised values that are seen in a block's place correlate too little with its own. */
std::optional<RegionRefiner::SeenBlock> RegionRefiner::compare(const Block& block,
                                                               const std::vector<float>& values) const
{
  using Row = Eigen::Array<float, SIDE, 1>;
  const float per_spread = static_cast<float>(1.0 / centring_.spread);
  const Row offsets = Row::LinSpaced(SIDE, -static_cast<float>(RADIUS), static_cast<float>(RADIUS));
  // Sums of gradients times differences along the rows; of these, and of these times x and x².
  float squares = 0.0F;
  Eigen::Matrix<float, 8, 1> right = Eigen::Matrix<float, 8, 1>::Zero();
  const Row x = (static_cast<float>(block.at.x() - centring_.middle.x()) + offsets) * per_spread;
  for (int row = 0; row < SIDE; ++row)
  {
    const float y = static_cast<float>(block.at.y() + row - RADIUS - centring_.middle.y()) * per_spread;
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
  const float correlation = 1.0F - 0.5F * squares;  // of two vectors of norm 1
  if (!(correlation >= min_correlation_))
  {
    return std::nullopt;
  }
  const double scale = static_cast<double>(block.norm) * static_cast<double>(block.norm) * centring_.spread;
  const double deviation = block.norm * std::sqrt(squares / static_cast<float>(values.size()));
  return SeenBlock{ &block, deviation, scale * right.cast<double>() };
}

/** The change by which the blocks are displaced, with Tukey's weights; empty when they do not determine it. */
std::optional<Eigen::Matrix3d> RegionRefiner::solve(const std::vector<SeenBlock>& seen) const
{
  constexpr double WIDTH = 3.0;  // of the weights, in median deviations
  std::vector<double> deviations;
  deviations.reserve(seen.size());
  for (const SeenBlock& block : seen)
  {
    deviations.push_back(block.deviation);
  }
  const double width = WIDTH * std::max(medianOf(std::move(deviations)), 1e-3);
  Matrix8 normal = Matrix8::Zero();
  Vector8 right = Vector8::Zero();
  for (const SeenBlock& block : seen)
  {
    const double ratio = block.deviation / width;
    const double weight = ratio < 1.0 ? (1.0 - ratio * ratio) * (1.0 - ratio * ratio) : 0.0;
    normal += weight * block.block->information;
    right += weight * block.right;
  }
  return solveChange(normal, right, centring_);
}

/** Of the corners of the square about the region's middle that has its mean extent [px]. */
double RegionRefiner::largestShift(const Eigen::Matrix3d& change) const
{
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
}

}  // namespace view_servo
