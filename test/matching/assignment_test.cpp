// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/assignment.h"

#include "view_servo/robust/ransac.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

namespace
{
using view_servo::Association;
using view_servo::AssociationMatrix;
using view_servo::greedyMatching;
using view_servo::maximumWeightMatching;

double total(const std::vector<Association>& matches)
{
  double sum = 0.0;
  for (const Association& match : matches)
  {
    sum += match.weight;
  }
  return sum;
}

bool isMatching(const std::vector<Association>& matches, const AssociationMatrix& matrix)
{
  std::set<int> rows;
  std::set<int> columns;
  for (const Association& match : matches)
  {
    if (!rows.insert(match.row).second || !columns.insert(match.column).second ||
        matrix.weight(match.row, match.column) != match.weight)
    {
      return false;
    }
  }
  return true;
}

/** Best total weight over all ways to match rows from `row` on. */
double bruteForce(const AssociationMatrix& matrix, int row, std::vector<char>& used)
{
  if (row == matrix.rows())
  {
    return 0.0;
  }
  double best = bruteForce(matrix, row + 1, used);
  for (std::size_t e = matrix.rowBegin(row); e < matrix.rowBegin(row + 1); ++e)
  {
    const Association& entry = matrix.entries()[e];
    char& taken = used[static_cast<std::size_t>(entry.column)];
    if (taken == 0)
    {
      taken = 1;
      best = std::max(best, entry.weight + bruteForce(matrix, row + 1, used));
      taken = 0;
    }
  }
  return best;
}

/**
 * A second solver, for large problems: Bertsekas' auction with prices, on the dense matrix padded to a square. With
 * whole weights and an increment below 1/n its result is optimal.
 */
double auction(const AssociationMatrix& matrix)
{
  const int n = matrix.rows() + matrix.columns();  // room for every row and column to stay unmatched
  const double increment = 0.9 / n;
  std::vector<double> prices(static_cast<std::size_t>(n), 0.0);
  std::vector<int> owner(static_cast<std::size_t>(n), -1);
  std::vector<int> unassigned;
  for (int i = 0; i < n; ++i)
  {
    unassigned.push_back(i);
  }
  const auto value = [&](int person, int object) {
    return person < matrix.rows() && object < matrix.columns() ? matrix.weight(person, object) : 0.0;
  };
  std::vector<int> object_of(static_cast<std::size_t>(n), -1);
  while (!unassigned.empty())
  {
    const int person = unassigned.back();
    unassigned.pop_back();
    double best = -std::numeric_limits<double>::infinity();
    double second = best;
    int chosen = -1;
    for (int object = 0; object < n; ++object)
    {
      const double profit = value(person, object) - prices[static_cast<std::size_t>(object)];
      if (profit > best)
      {
        second = best;
        best = profit;
        chosen = object;
      }
      else
      {
        second = std::max(second, profit);
      }
    }
    const std::size_t c = static_cast<std::size_t>(chosen);
    prices[c] += best - second + increment;
    if (owner[c] >= 0)
    {
      unassigned.push_back(owner[c]);
    }
    owner[c] = person;
    object_of[static_cast<std::size_t>(person)] = chosen;
  }
  double sum = 0.0;
  for (int person = 0; person < matrix.rows(); ++person)
  {
    sum += value(person, object_of[static_cast<std::size_t>(person)]);
  }
  return sum;
}

RC_GTEST_PROP(MaximumWeightMatching, EqualsBruteForceOnSmallProblems, ())
{
  const int rows = *rc::gen::inRange(0, 8);
  const int columns = *rc::gen::inRange(0, 8);
  std::vector<Association> entries;
  for (int row = 0; row < rows; ++row)
  {
    for (int column = 0; column < columns; ++column)
    {
      if (*rc::gen::inRange(0, 3) > 0)
      {
        entries.push_back({ row, column, static_cast<double>(*rc::gen::inRange(0, 12)) });
      }
    }
  }
  const AssociationMatrix matrix(rows, columns, entries);
  const std::vector<Association> matches = maximumWeightMatching(matrix);
  RC_ASSERT(isMatching(matches, matrix));
  std::vector<char> used(static_cast<std::size_t>(columns), 0);
  RC_ASSERT(total(matches) == bruteForce(matrix, 0, used));
  RC_ASSERT(isMatching(greedyMatching(matrix), matrix));
  RC_ASSERT(total(greedyMatching(matrix)) <= total(matches));
  RC_ASSERT(2.0 * total(greedyMatching(matrix)) >= total(matches));  // the known bound of the greedy matching
}

TEST(MaximumWeightMatching, EqualsAnAuctionOnLargeProblems)
{
  view_servo::Rng rng(11);
  for (const int density : { 2, 20, 100 })  // percent
  {
    std::vector<Association> entries;
    const int rows = 150;
    const int columns = 130;
    for (int row = 0; row < rows; ++row)
    {
      for (int column = 0; column < columns; ++column)
      {
        if (view_servo::uniformIndex(rng, 100) < static_cast<std::size_t>(density))
        {
          entries.push_back({ row, column, 1.0 + static_cast<double>(view_servo::uniformIndex(rng, 40)) });
        }
      }
    }
    const AssociationMatrix matrix(rows, columns, entries);
    const std::vector<Association> matches = maximumWeightMatching(matrix);
    EXPECT_TRUE(isMatching(matches, matrix));
    EXPECT_EQ(total(matches), auction(matrix)) << density << " % of the entries";
  }
}

TEST(MaximumWeightMatching, GivesUpALargeEntryForTwoLargerTogether)
{
  const AssociationMatrix matrix(2, 2, { { 0, 0, 5.0 }, { 0, 1, 4.0 }, { 1, 0, 4.0 } });
  EXPECT_EQ(total(maximumWeightMatching(matrix)), 8.0);
  EXPECT_EQ(total(greedyMatching(matrix)), 5.0);
}

TEST(MaximumWeightMatching, SortsTheHeaviestFirst)
{
  const AssociationMatrix matrix(3, 3, { { 0, 0, 1.0 }, { 1, 1, 3.0 }, { 2, 2, 2.0 } });
  for (const auto& matches : { maximumWeightMatching(matrix), greedyMatching(matrix) })
  {
    ASSERT_EQ(matches.size(), 3U);
    EXPECT_EQ(matches[0].row, 1);
    EXPECT_EQ(matches[1].row, 2);
    EXPECT_EQ(matches[2].row, 0);
  }
}

TEST(MaximumWeightMatching, OfNothingIsNothing)
{
  EXPECT_TRUE(maximumWeightMatching(AssociationMatrix()).empty());
  EXPECT_TRUE(maximumWeightMatching(AssociationMatrix(5, 0, {})).empty());
  EXPECT_TRUE(greedyMatching(AssociationMatrix(0, 5, {})).empty());
}

}  // namespace
