// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/assignment.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double INFINITE_COST = std::numeric_limits<double>::infinity();

void sortHeaviestFirst(std::vector<Association>& matches)
{
  std::stable_sort(matches.begin(), matches.end(), [](const Association& a, const Association& b) {
    return a.weight != b.weight ? a.weight > b.weight : (a.row != b.row ? a.row < b.row : a.column < b.column);
  });
}

/**
 * Minimum-cost assignment of every row to one of its entries (cost -weight) or to a private spare column (cost 0).
 *
 * Dual variables: `price[column]` <= 0 with price 0 for free columns; a row's reduced cost of an entry is
 * -weight - price[column] - profit[row] >= 0, and 0 on matched entries. Rows are added one by one along the shortest
 * augmenting path (Dijkstra over columns), which ends in a free column or in some row giving up its column for its
 * spare one.
 */
class SparseAssignment
{
public:
  explicit SparseAssignment(const AssociationMatrix& association)
    : association_(association),
      row_match_(static_cast<std::size_t>(association.rows()), NONE),
      column_match_(static_cast<std::size_t>(association.columns()), -1),
      price_(static_cast<std::size_t>(association.columns()), 0.0),
      distance_(static_cast<std::size_t>(association.columns()), INFINITE_COST),
      done_(static_cast<std::size_t>(association.columns()), 0),
      entry_to_(static_cast<std::size_t>(association.columns()), NONE)
  {
    for (int row = 0; row < association.rows(); ++row)
    {
      augment(row);
    }
  }

  std::vector<Association> matches() const
  {
    std::vector<Association> result;
    for (const std::size_t entry : row_match_)
    {
      if (entry != NONE)
      {
        result.push_back(association_.entries()[entry]);
      }
    }
    return result;
  }

private:
  static constexpr std::size_t NONE = std::numeric_limits<std::size_t>::max();
  using QueueItem = std::pair<double, int>;  // distance, column

  /** Cost of an entry with the column's price taken off; for a row's choice only differences matter. */
  double cost(std::size_t entry) const
  {
    const Association& e = association_.entries()[entry];
    return -e.weight - price_[static_cast<std::size_t>(e.column)];
  }

  /** The reduced cost 0 level of a matched row. */
  double profit(int row) const
  {
    const std::size_t entry = row_match_[static_cast<std::size_t>(row)];
    return entry == NONE ? 0.0 : cost(entry);
  }

  void relax(int row, double base)
  {
    // Path cost so far is `base`; leaving `row` by an entry adds its cost above the row's present level.
    const double level = profit(row);
    for (std::size_t e = association_.rowBegin(row); e < association_.rowBegin(row + 1); ++e)
    {
      const std::size_t column = static_cast<std::size_t>(association_.entries()[e].column);
      const double candidate = base + (cost(e) - level);
      if (done_[column] == 0 && candidate < distance_[column])
      {
        if (distance_[column] == INFINITE_COST)
        {
          touched_.push_back(static_cast<int>(column));
        }
        distance_[column] = candidate;
        entry_to_[column] = e;
        queue_.emplace(candidate, static_cast<int>(column));
      }
    }
    // ... or by its spare column, which costs 0 and has price 0.
    if (base - level < best_end_)
    {
      best_end_ = base - level;
      end_column_ = -1;
      end_row_ = row;
    }
  }

  void augment(int root)
  {
    queue_ = {};
    touched_.clear();
    best_end_ = INFINITE_COST;
    relax(root, 0.0);
    while (!queue_.empty())
    {
      const auto [length, column] = queue_.top();
      if (length >= best_end_)
      {
        break;
      }
      queue_.pop();
      const std::size_t c = static_cast<std::size_t>(column);
      if (done_[c] != 0)
      {
        continue;
      }
      done_[c] = 1;
      const int owner = column_match_[c];
      if (owner < 0)
      {
        best_end_ = length;
        end_column_ = column;
        end_row_ = -1;
        break;
      }
      relax(owner, length);
    }
    // New prices keep every reduced cost >= 0 and make those on the path 0.
    for (const int column : touched_)
    {
      const std::size_t c = static_cast<std::size_t>(column);
      if (done_[c] != 0 && distance_[c] < best_end_)
      {
        price_[c] += distance_[c] - best_end_;
      }
    }
    flip(root);
    for (const int column : touched_)
    {
      distance_[static_cast<std::size_t>(column)] = INFINITE_COST;
      done_[static_cast<std::size_t>(column)] = 0;
    }
  }

  /** Exchanges matched and unmatched entries along the path from `root` to where it ended. */
  void flip(int root)
  {
    int column = end_column_;
    if (column < 0)
    {
      if (end_row_ == root)
      {
        return;  // stays unmatched
      }
      const std::size_t given_up = row_match_[static_cast<std::size_t>(end_row_)];
      column = association_.entries()[given_up].column;
      row_match_[static_cast<std::size_t>(end_row_)] = NONE;
    }
    while (true)
    {
      const std::size_t entry = entry_to_[static_cast<std::size_t>(column)];
      const int row = association_.entries()[entry].row;
      const std::size_t previous = row_match_[static_cast<std::size_t>(row)];
      row_match_[static_cast<std::size_t>(row)] = entry;
      column_match_[static_cast<std::size_t>(column)] = row;
      if (row == root)
      {
        return;
      }
      column = association_.entries()[previous].column;
    }
  }

  const AssociationMatrix& association_;
  std::vector<std::size_t> row_match_;  // entry, NONE = unmatched
  std::vector<int> column_match_;       // row, -1 = free
  std::vector<double> price_;
  std::vector<double> distance_;
  std::vector<char> done_;
  std::vector<std::size_t> entry_to_;
  std::vector<int> touched_;
  std::priority_queue<QueueItem, std::vector<QueueItem>, std::greater<>> queue_;
  double best_end_ = INFINITE_COST;
  int end_column_ = -1;
  int end_row_ = -1;
};

}  // namespace

std::vector<Association> maximumWeightMatching(const AssociationMatrix& association)
{
  std::vector<Association> matches = SparseAssignment(association).matches();
  sortHeaviestFirst(matches);
  return matches;
}

std::vector<Association> greedyMatching(const AssociationMatrix& association)
{
  std::vector<Association> entries = association.entries();
  sortHeaviestFirst(entries);
  std::vector<char> row_used(static_cast<std::size_t>(association.rows()), 0);
  std::vector<char> column_used(static_cast<std::size_t>(association.columns()), 0);
  std::vector<Association> matches;
  for (const Association& entry : entries)
  {
    char& row = row_used[static_cast<std::size_t>(entry.row)];
    char& column = column_used[static_cast<std::size_t>(entry.column)];
    if (row == 0 && column == 0)
    {
      row = 1;
      column = 1;
      matches.push_back(entry);
    }
  }
  return matches;
}

}  // namespace view_servo
