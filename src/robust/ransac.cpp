// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/ransac.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace view_servo
{
std::vector<std::string> RansacParams::validate() const
{
  std::vector<std::string> faults;
  const auto require = [&faults](bool condition, const char* fault) {
    if (!condition)
    {
      faults.emplace_back(fault);
    }
  };
  require(inlier_threshold > 0.0 && std::isfinite(inlier_threshold), "inlier_threshold must be positive and finite");
  require(confidence > 0.0 && confidence < 1.0, "ransac_confidence must be between 0 and 1, both excluded");
  require(min_iterations >= 0, "ransac_min_iterations must not be negative");
  require(max_iterations >= 1, "ransac_max_iterations must be at least 1");
  require(max_rejected >= 0, "ransac_max_rejected must not be negative");
  require(local_optimizations >= 0, "local_optimizations must not be negative");
  require(sampling == Sampling::UNIFORM || sampling == Sampling::PROGRESSIVE,
          "sampling must be UNIFORM or PROGRESSIVE");
  return faults;
}

namespace detail
{
void drawDistinct(Rng& rng, std::size_t count, std::size_t size, std::vector<int>& sample)
{
  sample.clear();
  for (std::size_t last = count - size; last < count; ++last)
  {
    const int index = static_cast<int>(uniformIndex(rng, last + 1));
    const bool taken = std::find(sample.begin(), sample.end(), index) != sample.end();
    sample.push_back(taken ? static_cast<int>(last) : index);
  }
}

std::vector<int> randomOrder(Rng& rng, std::size_t count)
{
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  for (std::size_t i = count; i > 1; --i)
  {
    std::swap(order[i - 1], order[uniformIndex(rng, i)]);
  }
  return order;
}

void SequentialTest::setBest(double inlier_ratio)
{
  constexpr double FAILING = 0.25;
  constexpr double MAX_RATIO = 0.99;  // keeps the evidence of one outlier finite
  const double good = std::min(inlier_ratio, MAX_RATIO);
  inlier_evidence_ = good > 0.0 ? std::log(FAILING) : 0.0;
  outlier_evidence_ = std::log((1.0 - FAILING * good) / (1.0 - good));
}

Sampler::Sampler(Sampling sampling, std::size_t count, std::size_t size, double schedule_length)
  : count_(count),
    size_(size),
    prefix_(sampling == Sampling::PROGRESSIVE ? size : count),
    prefix_samples_(schedule_length),
    samples_drawn_(0.0),
    samples_to_grow_(1.0)
{
  // T_m = T_N prod (m - i) / (N - i), the samples out of T_N that fall into the first m data.
  for (std::size_t i = 0; i < size; ++i)
  {
    prefix_samples_ *= static_cast<double>(size - i) / static_cast<double>(count - i);
  }
}

void Sampler::draw(Rng& rng, std::vector<int>& sample)
{
  if (prefix_ >= count_)
  {
    drawDistinct(rng, count_, size_, sample);
    return;
  }
  samples_drawn_ += 1.0;
  if (samples_drawn_ > samples_to_grow_)
  {
    // T_n+1 = T_n (n + 1) / (n + 1 - m), T'_n+1 = T'_n + ceil(T_n+1 - T_n)
    const double n = static_cast<double>(prefix_);
    const double grown = prefix_samples_ * (n + 1.0) / (n + 1.0 - static_cast<double>(size_));
    samples_to_grow_ += std::ceil(grown - prefix_samples_);
    prefix_samples_ = grown;
    ++prefix_;
  }
  // Samples without the newest datum were drawn while the prefix was shorter: it is in every one of these.
  drawDistinct(rng, prefix_ - 1, size_ - 1, sample);
  sample.push_back(static_cast<int>(prefix_ - 1));
}

double requiredSamples(double inlier_ratio, int sample_size, double confidence)
{
  const double outlier_free = std::pow(inlier_ratio, sample_size);
  return std::log1p(-confidence) / std::log1p(-outlier_free);  // 0 / inf at a ratio of 1, -x / -0 = inf at 0
}

}  // namespace detail

}  // namespace view_servo
