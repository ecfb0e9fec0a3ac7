// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/association.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace
{
using view_servo::Association;
using view_servo::AssociationMatrix;

TEST(AssociationMatrix, SortsAddsAndLeavesOutWhatIsNotPositive)
{
  const AssociationMatrix matrix(3, 4, { { 2, 1, 0.5 }, { 0, 3, 1.0 }, { 2, 1, 0.25 }, { 0, 0, 0.0 }, { 1, 2, -1.0 } });
  ASSERT_EQ(matrix.entries().size(), 2U);
  EXPECT_EQ(matrix.rows(), 3);
  EXPECT_EQ(matrix.columns(), 4);
  EXPECT_EQ(matrix.weight(0, 3), 1.0);
  EXPECT_EQ(matrix.weight(2, 1), 0.75);
  EXPECT_EQ(matrix.weight(1, 2), 0.0);
  EXPECT_EQ(matrix.weight(0, 0), 0.0);
  EXPECT_EQ(matrix.weight(7, 0), 0.0);
  EXPECT_EQ(matrix.rowBegin(0), 0U);
  EXPECT_EQ(matrix.rowBegin(1), 1U);
  EXPECT_EQ(matrix.rowBegin(2), 1U);
  EXPECT_EQ(matrix.rowBegin(3), 2U);
}

TEST(AssociationMatrix, KeepsTheStrongestOfEachRow)
{
  const AssociationMatrix matrix(2, 3, { { 0, 0, 1.0 }, { 0, 1, 3.0 }, { 0, 2, 2.0 }, { 1, 2, 0.1 } });
  const AssociationMatrix strongest = matrix.strongestOfRows(2);
  ASSERT_EQ(strongest.entries().size(), 3U);
  EXPECT_EQ(strongest.weight(0, 0), 0.0);
  EXPECT_EQ(strongest.weight(0, 1), 3.0);
  EXPECT_EQ(strongest.weight(0, 2), 2.0);
  EXPECT_EQ(strongest.weight(1, 2), 0.1);
  EXPECT_TRUE(matrix.strongestOfRows(0).entries().empty());
}

TEST(AssociationMatrix, RefusesPlacesOutsideAndWeightsThatAreNoNumbers)
{
  EXPECT_THROW(AssociationMatrix(2, 2, { { 2, 0, 1.0 } }), std::invalid_argument);
  EXPECT_THROW(AssociationMatrix(2, 2, { { 0, -1, 1.0 } }), std::invalid_argument);
  EXPECT_THROW(AssociationMatrix(2, 2, { { 0, 0, std::numeric_limits<double>::quiet_NaN() } }), std::invalid_argument);
  EXPECT_THROW(AssociationMatrix(-1, 2, {}), std::invalid_argument);
}

TEST(AssociationMatrix, MayBeEmpty)
{
  const AssociationMatrix matrix;
  EXPECT_EQ(matrix.rows(), 0);
  EXPECT_EQ(matrix.rowBegin(0), 0U);
  EXPECT_EQ(matrix.weight(0, 0), 0.0);
}

}  // namespace
