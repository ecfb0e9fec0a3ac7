// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/profiles.h"

#include "view_servo/images/sampling.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int MAX_COEFFICIENTS = 8;
// Profiles are sampled about once a pixel; the number is a multiple of this, so that few basis tables are needed, ...
constexpr int SAMPLE_STEP = 8;
// ... and bounded, since eight low-order features need no more. [samples]
constexpr int MAX_SAMPLES = 48;

int sampleCount(double length)
{
  const int steps = static_cast<int>(std::ceil(length / SAMPLE_STEP));
  return std::min(MAX_SAMPLES, std::max(SAMPLE_STEP, steps * SAMPLE_STEP));
}

/**
 * The basis vectors of eq. 6.3 at (i + 1/2)/N, divided by N, for the first half of the samples: in the second they are
 * the same backwards, or the negative of that. Of each order one of sine and cosine is the one, and one the other.
 */
class Basis
{
public:
  using Row = Eigen::Array<float, MAX_COEFFICIENTS / 2, 1>;  // by order

  explicit Basis(int samples) : even_sum_(Row::Zero())
  {
    for (int i = 0; i < samples / 2; ++i)
    {
      even_.emplace_back();
      odd_.emplace_back();
      for (int k = 0; k < MAX_COEFFICIENTS / 2; ++k)
      {
        const double phase = M_PI * (k + 1) * (i + 0.5) / samples;
        const double sine = std::sin(phase) / samples;
        const double cosine = std::cos(phase) / samples;
        const bool sine_is_even = reversalSign(2 * k) > 0.0F;
        even_.back()[k] = static_cast<float>(sine_is_even ? sine : cosine);
        odd_.back()[k] = static_cast<float>(sine_is_even ? cosine : sine);
      }
      even_sum_ += 2.0F * even_.back();
    }
  }
  /** At a sample of the first half; the same at the one that mirrors it. */
  const Row& even(int i) const
  {
    return even_[static_cast<std::size_t>(i)];
  }
  /** At a sample of the first half; the negative at the one that mirrors it. */
  const Row& odd(int i) const
  {
    return odd_[static_cast<std::size_t>(i)];
  }
  /** The sum of even ones over all samples; that of odd ones is zero. */
  const Row& evenSum() const
  {
    return even_sum_;
  }

private:
  std::vector<Row> even_;
  std::vector<Row> odd_;
  Row even_sum_;
};

/** All tables that profiles need, the one of n steps of samples at place n - 1. */
const std::vector<Basis>& basisTables()
{
  static const std::vector<Basis> tables = [] {
    std::vector<Basis> result;
    for (int samples = SAMPLE_STEP; samples <= MAX_SAMPLES; samples += SAMPLE_STEP)
    {
      result.emplace_back(samples);
    }
    return result;
  }();
  return tables;
}

/** Both ends have to lie in the image. @return false when the contrast is too low. */
bool describe(const BilinearSampler& image, const Eigen::Vector2d& start, const Eigen::Vector2d& end, int coefficients,
              double min_contrast, float* features)
{
  const int samples = sampleCount((end - start).norm());
  const Basis& basis = basisTables()[static_cast<std::size_t>(samples / SAMPLE_STEP - 1)];
  const Eigen::Vector2f step = ((end - start) / samples).cast<float>();
  const Eigen::Vector2f first = start.cast<float>() + 0.5F * step;
  Eigen::Array<float, MAX_SAMPLES, 1> intensities;
  image.alongLine(first, step, samples, intensities.data());
  const auto sampled = intensities.head(samples);
  const float mean = sampled.sum() / static_cast<float>(samples);
  const float contrast = std::max(sampled.maxCoeff() - mean, mean - sampled.minCoeff());
  if (static_cast<double>(contrast) < min_contrast)
  {
    return false;
  }
  Basis::Row even = -mean * basis.evenSum();
  Basis::Row odd = Basis::Row::Zero();
  for (int i = 0; i < samples / 2; ++i)
  {
    const float before = intensities[i];
    const float after = intensities[samples - 1 - i];
    even += (before + after) * basis.even(i);
    odd += (before - after) * basis.odd(i);
  }
  for (int c = 0; c < coefficients; ++c)
  {
    features[c] = (reversalSign(c) > 0.0F ? even : odd)[c / 2] / contrast;
  }
  return true;
}

void requireGrey(const cv::Mat& image)
{
  if (image.type() != CV_8UC1)
  {
    throw std::invalid_argument("intensity profiles need an 8-bit image with one channel");
  }
}

/** Corners by where they are, so that those near a place are found without a look at all others. */
class CornerGrid
{
public:
  explicit CornerGrid(const std::vector<Corner>& corners)
  {
    constexpr double CORNERS_A_CELL = 6.0;  // on average
    Eigen::AlignedBox2d box;
    for (const Corner& corner : corners)
    {
      box.extend(corner.position);
    }
    const Eigen::Vector2d size = corners.empty() ? Eigen::Vector2d(0.0, 0.0) : Eigen::Vector2d(box.sizes());
    low_ = corners.empty() ? Eigen::Vector2d(0.0, 0.0) : box.min();
    // Where all lie on a line, cells are as long as if there were a narrow strip.
    const double area = std::max(size.x(), 1.0) * std::max(size.y(), 1.0);
    cell_ =
        std::max(1.0, std::sqrt(area * CORNERS_A_CELL / static_cast<double>(std::max<std::size_t>(1, corners.size()))));
    columns_ = static_cast<int>(size.x() / cell_) + 1;
    rows_ = static_cast<int>(size.y() / cell_) + 1;
    cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
    for (std::size_t i = 0; i < corners.size(); ++i)
    {
      const auto [column, row] = cellOf(corners[i].position);
      cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)]
          .push_back(i);
    }
  }

  /**
   * Calls visit(number) for all corners up to a distance, and for some that are farther away [px].
   * @return whether these are all corners.
   */
  template <typename Visit>
  bool visitNear(const Eigen::Vector2d& place, double distance, const Visit& visit) const
  {
    const auto [left, top] = cellOf(place - Eigen::Vector2d(distance, distance));
    const auto [right, bottom] = cellOf(place + Eigen::Vector2d(distance, distance));
    for (int row = top; row <= bottom; ++row)
    {
      for (int column = left; column <= right; ++column)
      {
        for (const std::size_t i : cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                                          static_cast<std::size_t>(column)])
        {
          visit(i);
        }
      }
    }
    return left == 0 && top == 0 && right == columns_ - 1 && bottom == rows_ - 1;
  }

  double cell() const
  {
    return cell_;
  }

private:
  /** Of the nearest cell, column and row. */
  std::pair<int, int> cellOf(const Eigen::Vector2d& place) const
  {
    const Eigen::Vector2d offset = (place - low_) / cell_;
    return { static_cast<int>(std::clamp(offset.x(), 0.0, columns_ - 1.0)),
             static_cast<int>(std::clamp(offset.y(), 0.0, rows_ - 1.0)) };
  }

  Eigen::Vector2d low_;
  double cell_ = 1.0;  // side [px]
  int columns_ = 1;
  int rows_ = 1;
  std::vector<std::vector<std::size_t>> cells_;
};

/** Another corner and its squared distance [px^2]. */
using NearCorner = std::pair<double, std::size_t>;

/** Sets the other corners that a corner is paired with, in any order. */
void selectPartners(const std::vector<Corner>& corners, const CornerGrid& grid, std::size_t corner,
                    const ProfileParams& params, std::vector<NearCorner>& partners)
{
  const bool nearest = params.selection == PairSelection::NEAREST;
  const double min_squared = params.min_length * params.min_length;
  const Eigen::Vector2d& place = corners[corner].position;
  // Of the nearest it is not known how far away they are: as many as are in a few cells, or as far as was found there.
  double distance = nearest ? 1.5 * grid.cell() : params.max_length;
  while (true)
  {
    partners.clear();
    const bool all = grid.visitNear(place, distance, [&](std::size_t other) {
      const double squared = (corners[other].position - place).squaredNorm();
      if (squared >= min_squared && (nearest || squared <= params.max_length * params.max_length))
      {
        partners.emplace_back(squared, other);
      }
    });
    if (!nearest)
    {
      return;
    }
    const auto wanted = static_cast<std::size_t>(params.neighbours);
    if (partners.size() > wanted)
    {
      const auto last = partners.begin() + static_cast<std::ptrdiff_t>(wanted - 1);
      std::nth_element(partners.begin(), last, partners.end());
      const double farthest = std::sqrt(last->first);
      if (all || farthest <= distance)
      {
        partners.resize(wanted);
        return;
      }
      distance = farthest;
      continue;
    }
    if (all)
    {
      return;
    }
    distance *= 2.0;
  }
}

/** Unordered pairs by the selection of the parameters, start < end, sorted. */
std::vector<ProfileSet::Pair> selectPairs(const std::vector<Corner>& corners, const ProfileParams& params)
{
  const std::size_t n = corners.size();
  const CornerGrid grid(corners);
  std::vector<std::vector<NearCorner>> partners(n);
  cv::parallel_for_(cv::Range(0, static_cast<int>(n)), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
    {
      selectPartners(corners, grid, static_cast<std::size_t>(i), params, partners[static_cast<std::size_t>(i)]);
    }
  });
  std::vector<char> paired(n * n, 0);  // row: the smaller number
  for (std::size_t i = 0; i < n; ++i)
  {
    for (const auto& [squared, j] : partners[i])
    {
      paired[std::min(i, j) * n + std::max(i, j)] = 1;
    }
  }
  std::vector<ProfileSet::Pair> pairs;
  for (std::size_t i = 0; i < n; ++i)
  {
    for (std::size_t j = i + 1; j < n; ++j)
    {
      if (paired[i * n + j] != 0)
      {
        pairs.push_back({ static_cast<int>(i), static_cast<int>(j) });
      }
    }
  }
  return pairs;
}

/** Zero mean and unit deviation of every feature over the profiles read in both directions. */
void normalize(ProfileSet& set)
{
  if (set.pairs.empty())
  {
    return;
  }
  const std::size_t columns = static_cast<std::size_t>(set.coefficients);
  const double count = static_cast<double>(set.pairs.size());
  for (std::size_t c = 0; c < columns; ++c)
  {
    double sum = 0.0;
    double squares = 0.0;
    for (std::size_t i = c; i < set.features.size(); i += columns)
    {
      const double value = static_cast<double>(set.features[i]);
      sum += value;
      squares += value * value;
    }
    const double mean = reversalSign(static_cast<int>(c)) < 0.0F ? 0.0 : sum / count;
    const double variance = squares / count - mean * mean;
    const double scale = variance > 1e-12 ? 1.0 / std::sqrt(variance) : 0.0;
    for (std::size_t i = c; i < set.features.size(); i += columns)
    {
      set.features[i] = static_cast<float>((static_cast<double>(set.features[i]) - mean) * scale);
    }
  }
}

}  // namespace

std::vector<Parameter> parameters(ProfileParams& params)
{
  return {
    choice<PairSelection>("pair_selection", params.selection,
                          { { "nearest", PairSelection::NEAREST }, { "radius", PairSelection::RADIUS } },
                          "pair each corner with its nearest (K_c) or with all in a radius (D_c)"),
    integer("pair_neighbours", params.neighbours, "", ">= 1", "K_c: corners that each is paired with"),
    real("pair_radius", params.max_length, "px", "> profile_min_length", "D_c: longest profile"),
    real("profile_min_length", params.min_length, "px", ">= 2", "shortest profile"),
    integer("coefficients", params.coefficients, "", "4, 6 or 8", "N_f: Fourier features of each profile"),
    real("profile_contrast", params.min_contrast, "grey levels", "(0, 255)",
         "least deviation of a profile from its mean"),
  };
}

std::vector<std::string> ProfileParams::validate() const
{
  return faultsOf(*this);
}

ProfileSet extractProfiles(const cv::Mat& image, const std::vector<Corner>& corners, const ProfileParams& params)
{
  requireGrey(image);
  ProfileSet set;
  set.coefficients = params.coefficients;
  const std::vector<ProfileSet::Pair> pairs = selectPairs(corners, params);
  const std::size_t columns = static_cast<std::size_t>(params.coefficients);
  std::vector<float> features(pairs.size() * columns);
  std::vector<char> described(pairs.size(), 0);
  const BilinearSampler sampler(image);
  cv::parallel_for_(cv::Range(0, static_cast<int>(pairs.size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
    {
      const std::size_t k = static_cast<std::size_t>(i);
      const Eigen::Vector2d& start = corners[static_cast<std::size_t>(pairs[k].start)].position;
      const Eigen::Vector2d& end = corners[static_cast<std::size_t>(pairs[k].end)].position;
      const bool good =
          sampler.contains(start.x(), start.y()) && sampler.contains(end.x(), end.y()) &&
          describe(sampler, start, end, params.coefficients, params.min_contrast, features.data() + k * columns);
      described[k] = good ? 1 : 0;
    }
  });
  // In place: what is kept never overtakes what is read.
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    if (described[k] != 0)
    {
      std::copy_n(features.begin() + static_cast<std::ptrdiff_t>(k * columns), columns,
                  features.begin() + static_cast<std::ptrdiff_t>(set.pairs.size() * columns));
      set.pairs.push_back(pairs[k]);
    }
  }
  features.resize(set.pairs.size() * columns);
  set.features = std::move(features);
  normalize(set);
  return set;
}

bool profileFeatures(const cv::Mat& image, const Eigen::Vector2d& start, const Eigen::Vector2d& end,
                     const ProfileParams& params, float* features)
{
  requireGrey(image);
  const BilinearSampler sampler(image);
  if (!sampler.contains(start.x(), start.y()) || !sampler.contains(end.x(), end.y()))
  {
    return false;
  }
  return describe(sampler, start, end, params.coefficients, params.min_contrast, features);
}

}  // namespace view_servo
