// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/association.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
bool placeLess(const Association& a, const Association& b)
{
  return a.row != b.row ? a.row < b.row : a.column < b.column;
}
}  // namespace

AssociationMatrix::AssociationMatrix(int rows, int columns, std::vector<Association> entries)
  : rows_(rows), columns_(columns)
{
  if (rows < 0 || columns < 0)
  {
    throw std::invalid_argument("AssociationMatrix: negative size");
  }
  for (const Association& entry : entries)
  {
    if (entry.row < 0 || entry.row >= rows || entry.column < 0 || entry.column >= columns ||
        !std::isfinite(entry.weight))
    {
      throw std::invalid_argument("AssociationMatrix: an entry lies outside the matrix or its weight is not finite");
    }
  }
  if (!std::is_sorted(entries.begin(), entries.end(), placeLess))
  {
    std::stable_sort(entries.begin(), entries.end(), placeLess);
  }
  // In place: what is kept never overtakes what is read.
  std::size_t kept = 0;
  for (std::size_t i = 0; i < entries.size();)
  {
    Association sum = entries[i];
    for (++i; i < entries.size() && entries[i].row == sum.row && entries[i].column == sum.column; ++i)
    {
      sum.weight += entries[i].weight;
    }
    if (sum.weight > 0.0)
    {
      entries[kept] = sum;
      ++kept;
    }
  }
  entries.resize(kept);
  entries_ = std::move(entries);
  row_begin_.assign(static_cast<std::size_t>(rows) + 1, 0);
  for (const Association& entry : entries_)
  {
    ++row_begin_[static_cast<std::size_t>(entry.row) + 1];
  }
  for (std::size_t row = 0; row < static_cast<std::size_t>(rows); ++row)
  {
    row_begin_[row + 1] += row_begin_[row];
  }
}

double AssociationMatrix::weight(int row, int column) const
{
  if (row < 0 || row >= rows_)
  {
    return 0.0;
  }
  const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(rowBegin(row + 1));
  const auto found = std::lower_bound(entries_.begin() + static_cast<std::ptrdiff_t>(rowBegin(row)), end,
                                      Association{ row, column, 0.0 }, placeLess);
  return found != end && found->column == column ? found->weight : 0.0;
}

AssociationMatrix AssociationMatrix::strongestOfRows(int count) const
{
  std::vector<Association> kept;
  for (int row = 0; row < rows_; ++row)
  {
    const auto begin = entries_.begin() + static_cast<std::ptrdiff_t>(rowBegin(row));
    const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(rowBegin(row + 1));
    std::vector<Association> entries(begin, end);
    const std::size_t taken = std::min(entries.size(), static_cast<std::size_t>(std::max(0, count)));
    std::partial_sort(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(taken), entries.end(),
                      [](const Association& a, const Association& b) {
                        return a.weight != b.weight ? a.weight > b.weight : a.column < b.column;
                      });
    entries.resize(taken);
    kept.insert(kept.end(), entries.begin(), entries.end());
  }
  return AssociationMatrix(rows_, columns_, std::move(kept));
}

}  // namespace view_servo
