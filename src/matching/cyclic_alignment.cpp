// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/cyclic_alignment.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace view_servo
{
namespace
{
constexpr float UNREACHABLE = -std::numeric_limits<float>::infinity();
}

float CyclicAligner::align(const float* weights, int rows, int columns)
{
  if (rows <= 0 || columns <= 0)
  {
    return 0.0F;
  }
  rows_ = rows;
  columns_ = columns;
  weights_.clear();
  gains_.assign(static_cast<std::size_t>(columns) + 1, 0.0F);
  for (int row = 0; row < rows; ++row)
  {
    const float* first = weights + static_cast<std::size_t>(row) * static_cast<std::size_t>(columns);
    weights_.insert(weights_.end(), first, first + columns);
    weights_.insert(weights_.end(), first, first + columns);
    for (int column = 0; column < columns; ++column)
    {
      float& gain = gains_[static_cast<std::size_t>(column) + 1];
      gain = std::max(gain, first[column]);
    }
  }
  std::partial_sum(gains_.begin(), gains_.end(), gains_.begin());
  table_.resize((static_cast<std::size_t>(rows) + 1) * (2 * static_cast<std::size_t>(columns) + 1));
  std::size_t levels = 3;
  for (int n = columns; n > 1; n = (n + 1) / 2)
  {
    ++levels;
  }
  paths_.resize(std::max(paths_.size(), levels));

  // The columns stand twice side by side; rotation k runs from (0, k) to (rows, k + columns). Rotation `columns`
  // is rotation 0 again, moved by one period.
  best_ = alignRotation(0, nullptr, nullptr, paths_[0]);
  paths_[1] = paths_[0];
  for (std::size_t row = 0; row <= static_cast<std::size_t>(rows); ++row)
  {
    paths_[1].first[row] += columns;
    paths_[1].last[row] += columns;
  }
  stack_size_ = 2;
  divide({ 0, best_, 0 }, { columns, best_, 1 });
  return best_;
}

void CyclicAligner::divide(const Rotation& left, const Rotation& right)
{
  // Any rotation between weighs at most left + (what comes after left) and right + (what comes before right).
  const float between =
      gains_[static_cast<std::size_t>(right.columns)] - gains_[static_cast<std::size_t>(left.columns)];
  Rotation middle{ (left.columns + right.columns) / 2, 0.0F, stack_size_ };
  if (middle.columns == left.columns || 0.5F * (left.weight + right.weight + between) <= best_)
  {
    return;
  }
  ++stack_size_;
  middle.weight = alignRotation(middle.columns, &paths_[left.path], &paths_[right.path], paths_[middle.path]);
  best_ = std::max(best_, middle.weight);
  // The better side first: what it finds may spare the other.
  if (left.weight >= right.weight)
  {
    divide(left, middle);
    divide(middle, right);
  }
  else
  {
    divide(middle, right);
    divide(left, middle);
  }
  --stack_size_;
}

float CyclicAligner::alignRotation(int rotation, const Path* left, const Path* right, Path& path)
{
  const std::size_t stride = 2 * static_cast<std::size_t>(columns_) + 1;
  const auto low = [&](int row) {
    return left == nullptr ? rotation : std::max(rotation, left->first[static_cast<std::size_t>(row)]);
  };
  const auto high = [&](int row) {
    const int end = rotation + columns_;
    return right == nullptr ? end : std::min(end, right->last[static_cast<std::size_t>(row)]);
  };

  // Cell (i, j): best weight of the first i rows against columns rotation .. j - 1; each row only within its band.
  std::fill(table_.begin() + low(0), table_.begin() + high(0) + 1, 0.0F);
  for (int i = 1; i <= rows_; ++i)
  {
    float* above = table_.data() + static_cast<std::size_t>(i - 1) * stride;
    float* here = table_.data() + static_cast<std::size_t>(i) * stride;
    const float* row_weights = weights_.data() + static_cast<std::size_t>(i - 1) * (stride - 1);
    const int first = low(i);
    const int last = high(i);
    // Bands only move to the right, so this row reads beyond the band above by one cell to the left, some to the right.
    if (first > 0 && low(i - 1) == first)
    {
      above[first - 1] = UNREACHABLE;
    }
    std::fill(above + high(i - 1) + 1, above + last + 1, UNREACHABLE);
    here[first] = first > 0 ? std::max(above[first], above[first - 1] + row_weights[first - 1]) : above[first];
    for (int j = first + 1; j <= last; ++j)
    {
      here[j] = std::max(above[j], above[j - 1] + row_weights[j - 1]);
    }
    for (int j = first + 1; j <= last; ++j)
    {
      here[j] = std::max(here[j], here[j - 1]);
    }
  }

  // Back from the end; among equal ways any is optimal.
  path.first.resize(static_cast<std::size_t>(rows_) + 1);
  path.last.resize(static_cast<std::size_t>(rows_) + 1);
  int j = rotation + columns_;
  const float weight = table_[static_cast<std::size_t>(rows_) * stride + static_cast<std::size_t>(j)];
  for (int i = rows_; i > 0; --i)
  {
    const float* above = table_.data() + static_cast<std::size_t>(i - 1) * stride;
    const float* here = table_.data() + static_cast<std::size_t>(i) * stride;
    const int first = low(i);
    path.last[static_cast<std::size_t>(i)] = j;
    while (j > first && here[j - 1] == here[j])
    {
      --j;
    }
    path.first[static_cast<std::size_t>(i)] = j;
    if (j < low(i - 1) || j > high(i - 1) || above[j] != here[j])
    {
      --j;  // the diagonal: row i - 1 is paired with column j - 1
    }
  }
  path.last[0] = j;
  path.first[0] = rotation;
  return weight;
}

}  // namespace view_servo
