// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace view_servo
{
/** How strongly reference feature `row` is associated with current feature `column`. */
struct Association
{
  int row;        ///< index of the reference feature
  int column;     ///< index of the current feature
  double weight;  ///< > 0, in no unit; larger is stronger
};

/**
 * Sparse association matrix (thesis 4.4, 6.1.4): rows are reference features, columns current features, entries > 0.
 * Shared by points, lines and the estimators that keep several hypotheses. Entries are sorted by row, then column.
 */
class AssociationMatrix
{
public:
  AssociationMatrix() = default;

  /**
   * Entries with weight <= 0 are left out; the weights of entries with the same place are added.
   * @throws std::invalid_argument when an index lies outside the matrix or a weight is not finite.
   */
  AssociationMatrix(int rows, int columns, std::vector<Association> entries);

  int rows() const
  {
    return rows_;
  }
  int columns() const
  {
    return columns_;
  }
  const std::vector<Association>& entries() const
  {
    return entries_;
  }
  /** Index of the first entry of a row; rowBegin(rows()) == entries().size(). */
  std::size_t rowBegin(int row) const
  {
    return row_begin_[static_cast<std::size_t>(row)];
  }
  /** The entry's weight, 0 where there is none. */
  double weight(int row, int column) const;

  /** A copy with only the `count` largest entries of each row (thesis 9.5 uses 10). */
  AssociationMatrix strongestOfRows(int count) const;

private:
  int rows_ = 0;
  int columns_ = 0;
  std::vector<Association> entries_;
  std::vector<std::size_t> row_begin_{ 0 };
};

}  // namespace view_servo
