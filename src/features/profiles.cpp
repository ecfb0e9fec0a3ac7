// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/profiles.h"

#include "view_servo/images/sampling.h"

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

/** The basis vectors of eq. 6.3 at (i + 1/2)/N, divided by N; row i holds sin 1, cos 1, sin 2, .. */
class Basis
{
public:
  Basis(int samples, int coefficients) : coefficients_(static_cast<std::size_t>(coefficients)), sums_{}
  {
    for (int i = 0; i < samples; ++i)
    {
      for (int c = 0; c < coefficients; ++c)
      {
        const int order = c / 2 + 1;
        const double phase = M_PI * order * (i + 0.5) / samples;
        const double value = (c % 2 == 0 ? std::sin(phase) : std::cos(phase)) / samples;
        values_.push_back(static_cast<float>(value));
        sums_[c] += static_cast<float>(value);
      }
    }
  }
  const float* row(int i) const
  {
    return values_.data() + static_cast<std::size_t>(i) * coefficients_;
  }
  float sum(int c) const
  {
    return sums_[c];
  }

private:
  std::size_t coefficients_;
  std::vector<float> values_;
  float sums_[MAX_COEFFICIENTS];
};

/** All tables that profiles up to a length need. */
std::vector<Basis> basisTables(int coefficients)
{
  std::vector<Basis> tables;
  for (int samples = SAMPLE_STEP; samples <= MAX_SAMPLES; samples += SAMPLE_STEP)
  {
    tables.emplace_back(samples, coefficients);
  }
  return tables;
}

template <int Coefficients>
bool describe(const BilinearSampler& image, const Eigen::Vector2d& start, const Eigen::Vector2d& end, int samples,
              const Basis& basis, double min_contrast, float* features)
{
  float intensities[MAX_SAMPLES];
  float sums[Coefficients] = {};
  const Eigen::Vector2f step = ((end - start) / samples).cast<float>();
  const Eigen::Vector2f first = start.cast<float>() + 0.5F * step;
  float total = 0.0F;
  for (int i = 0; i < samples; ++i)
  {
    const float u = first.x() + static_cast<float>(i) * step.x();
    const float v = first.y() + static_cast<float>(i) * step.y();
    const float intensity = image.at(u, v);
    intensities[i] = intensity;
    total += intensity;
    const float* b = basis.row(i);
    for (int c = 0; c < Coefficients; ++c)
    {
      sums[c] += intensity * b[c];
    }
  }
  const float mean = total / static_cast<float>(samples);
  float contrast = 0.0F;
  for (int i = 0; i < samples; ++i)
  {
    contrast = std::max(contrast, std::abs(intensities[i] - mean));
  }
  if (static_cast<double>(contrast) < min_contrast)
  {
    return false;
  }
  for (int c = 0; c < Coefficients; ++c)
  {
    features[c] = (sums[c] - mean * basis.sum(c)) / contrast;
  }
  return true;
}

bool describe(const BilinearSampler& image, const Eigen::Vector2d& start, const Eigen::Vector2d& end, int coefficients,
              const std::vector<Basis>& tables, double min_contrast, float* features)
{
  const int samples = sampleCount((end - start).norm());
  const Basis& basis = tables[static_cast<std::size_t>(samples / SAMPLE_STEP - 1)];
  switch (coefficients)
  {
    case 4:
      return describe<4>(image, start, end, samples, basis, min_contrast, features);
    case 6:
      return describe<6>(image, start, end, samples, basis, min_contrast, features);
    default:
      return describe<8>(image, start, end, samples, basis, min_contrast, features);
  }
}

void requireGrey(const cv::Mat& image)
{
  if (image.type() != CV_8UC1)
  {
    throw std::invalid_argument("intensity profiles need an 8-bit image with one channel");
  }
}

/** Unordered pairs by the selection of the parameters, start < end, sorted. */
std::vector<ProfileSet::Pair> selectPairs(const std::vector<Corner>& corners, const ProfileParams& params)
{
  const std::size_t n = corners.size();
  const double min_squared = params.min_length * params.min_length;
  const double max_squared = params.selection == PairSelection::RADIUS ? params.max_length * params.max_length
                                                                       : std::numeric_limits<double>::infinity();
  const std::size_t limit =
      params.selection == PairSelection::NEAREST ? static_cast<std::size_t>(params.neighbours) : n;
  std::vector<char> chosen(n * n, 0);  // row i: the corners that i is paired with
  cv::parallel_for_(cv::Range(0, static_cast<int>(n)), [&](const cv::Range& range) {
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t i = static_cast<std::size_t>(range.start); i < static_cast<std::size_t>(range.end); ++i)
    {
      near.clear();
      for (std::size_t j = 0; j < n; ++j)
      {
        const double squared = (corners[j].position - corners[i].position).squaredNorm();
        if (squared >= min_squared && squared <= max_squared)
        {
          near.emplace_back(squared, j);
        }
      }
      const std::size_t wanted = std::min(near.size(), limit);
      std::nth_element(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(wanted), near.end());
      for (std::size_t k = 0; k < wanted; ++k)
      {
        chosen[i * n + near[k].second] = 1;
      }
    }
  });
  std::vector<ProfileSet::Pair> pairs;
  for (std::size_t i = 0; i < n; ++i)
  {
    for (std::size_t j = i + 1; j < n; ++j)
    {
      if (chosen[i * n + j] != 0 || chosen[j * n + i] != 0)
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
    integer("coefficients", params.coefficients, "", "4, 6 or 8", "N_f: Fourier features a profile"),
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
  const std::vector<Basis> tables = basisTables(params.coefficients);
  const BilinearSampler sampler(image);
  cv::parallel_for_(cv::Range(0, static_cast<int>(pairs.size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
    {
      const std::size_t k = static_cast<std::size_t>(i);
      const Eigen::Vector2d& start = corners[static_cast<std::size_t>(pairs[k].start)].position;
      const Eigen::Vector2d& end = corners[static_cast<std::size_t>(pairs[k].end)].position;
      const bool good = sampler.contains(start.x(), start.y()) && sampler.contains(end.x(), end.y()) &&
                        describe(sampler, start, end, params.coefficients, tables, params.min_contrast,
                                 features.data() + k * columns);
      described[k] = good ? 1 : 0;
    }
  });
  for (std::size_t k = 0; k < pairs.size(); ++k)
  {
    if (described[k] != 0)
    {
      set.pairs.push_back(pairs[k]);
      set.features.insert(set.features.end(), features.begin() + static_cast<std::ptrdiff_t>(k * columns),
                          features.begin() + static_cast<std::ptrdiff_t>((k + 1) * columns));
    }
  }
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
  return describe(sampler, start, end, params.coefficients, basisTables(params.coefficients), params.min_contrast,
                  features);
}

}  // namespace view_servo
