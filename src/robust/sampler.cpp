// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/sampler.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int MAX_DRAWS = 1000;    // for one entry that shares no row or column
constexpr int MAX_RESTARTS = 100;  // of one sample

std::vector<int> firstNumbers(std::size_t count)
{
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

}  // namespace

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

}  // namespace detail

ListSampler::ListSampler(Sampling sampling, std::size_t count, std::size_t size, double schedule_length)
  : ListSampler(sampling, firstNumbers(count), size, schedule_length)
{
}

ListSampler::ListSampler(Sampling sampling, std::vector<int> data, std::size_t size, double schedule_length)
  : data_(std::move(data)),
    sorted_(data_),
    size_(size),
    prefix_(sampling == Sampling::PROGRESSIVE ? std::min(size, data_.size()) : data_.size()),
    prefix_samples_(schedule_length),
    samples_drawn_(0.0),
    samples_to_grow_(1.0)
{
  std::sort(sorted_.begin(), sorted_.end());
  // T_m = T_N prod (m - i) / (N - i), the samples out of T_N that fall into the first m data.
  for (std::size_t i = 0; i < std::min(size, data_.size()); ++i)
  {
    prefix_samples_ *= static_cast<double>(size - i) / static_cast<double>(data_.size() - i);
  }
}

bool ListSampler::draw(Rng& rng, std::vector<int>& sample)
{
  if (data_.size() < size_)
  {
    return false;
  }
  if (prefix_ >= data_.size())
  {
    detail::drawDistinct(rng, data_.size(), size_, sample);
  }
  else
  {
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
    detail::drawDistinct(rng, prefix_ - 1, size_ - 1, sample);
    sample.push_back(static_cast<int>(prefix_ - 1));
  }
  for (int& index : sample)
  {
    index = data_[static_cast<std::size_t>(index)];
  }
  return true;
}

double ListSampler::share(const std::vector<int>& inliers) const
{
  std::size_t common = 0;
  auto next = inliers.begin();
  for (const int datum : sorted_)
  {
    next = std::lower_bound(next, inliers.end(), datum);
    common += next != inliers.end() && *next == datum ? 1 : 0;
  }
  return data_.empty() ? 0.0 : static_cast<double>(common) / static_cast<double>(data_.size());
}

bool ListSampler::replace(Rng& /*rng*/, int trial, std::size_t position, std::vector<int>& sample) const
{
  const int datum = data_[static_cast<std::size_t>(trial)];
  if (std::find(sample.begin(), sample.end(), datum) != sample.end())
  {
    return false;
  }
  sample[position] = datum;
  return true;
}

ImportanceSampler::ImportanceSampler(const AssociationMatrix& association, std::size_t size, int replacements)
  : association_(association), size_(size), replacements_(replacements)
{
  double sum = 0.0;
  for (const Association& entry : association.entries())
  {
    sum += entry.weight;
    cumulated_.push_back(sum);
  }
}

int ImportanceSampler::drawEntry(Rng& rng) const
{
  const double place = uniform(rng, 0.0, cumulated_.back());
  const auto found = std::upper_bound(cumulated_.begin(), cumulated_.end() - 1, place);
  return static_cast<int>(found - cumulated_.begin());
}

bool ImportanceSampler::collides(int entry, const std::vector<int>& sample, std::size_t except) const
{
  const Association& drawn = association_.entries()[static_cast<std::size_t>(entry)];
  for (std::size_t i = 0; i < sample.size(); ++i)
  {
    const Association& other = association_.entries()[static_cast<std::size_t>(sample[i])];
    if (i != except && (other.row == drawn.row || other.column == drawn.column))
    {
      return true;
    }
  }
  return false;
}

bool ImportanceSampler::draw(Rng& rng, std::vector<int>& sample)
{
  sample.clear();
  if (cumulated_.empty())
  {
    return false;
  }
  int restarts = 0;
  for (int draws = 0; sample.size() < size_; ++draws)
  {
    if (draws > MAX_DRAWS)
    {
      if (restarts >= MAX_RESTARTS)
      {
        return false;  // there are too few rows or columns
      }
      ++restarts;  // what was drawn first may leave no place for the others
      sample.clear();
      draws = 0;
    }
    const int entry = drawEntry(rng);
    if (!collides(entry, sample, sample.size()))
    {
      sample.push_back(entry);
      draws = 0;
    }
  }
  return true;
}

double ImportanceSampler::share(const std::vector<int>& inliers) const
{
  double sum = 0.0;
  for (const int entry : inliers)
  {
    sum += association_.entries()[static_cast<std::size_t>(entry)].weight;
  }
  return cumulated_.empty() ? 0.0 : sum / cumulated_.back();
}

bool ImportanceSampler::replace(Rng& rng, int /*trial*/, std::size_t position, std::vector<int>& sample) const
{
  for (int draws = 0; draws < MAX_DRAWS; ++draws)
  {
    const int entry = drawEntry(rng);
    if (entry != sample[position] && !collides(entry, sample, position))
    {
      sample[position] = entry;
      return true;
    }
  }
  return false;
}

}  // namespace view_servo
